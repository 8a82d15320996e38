//! The picture without its noise, by Open Image Denoise where its library is there: a layer beside the
//! picture, and what `picture.png` shows. The picture itself, and what a sensor makes of its light, stay as
//! they are.

use etendue_oidn::{Denoiser, Guides};
use etendue_report::Refusal;
use etendue_scene::Scene;
use etendue_tracer::LayerSpec;

use crate::RenderError;
use crate::expose::{has_spectrum, three_planes};
use crate::memory::{NoMemory, filled};
pub use crate::output::DENOISED;
use crate::output::{Channel, HeaderEntry, Layer, Look, Picture, Values};

/// Bytes a pixel of the picture and its guides on their way through the library, which takes more by
/// itself, and of what comes back.
pub(crate) const BYTES: u64 = 48;

/// Entry of files' headers that says that a picture was denoised.
#[must_use]
pub fn fingerprint() -> HeaderEntry {
    HeaderEntry::new("denoised", format!("picture.png shows the layer {DENOISED}"))
}

/// Adds to the layers of `scene` what guides the library.
///
/// # Errors
///
/// When its picture is no light in red, green and blue.
pub fn guide(scene: &mut Scene) -> Result<(), RenderError> {
    let refused =
        |why: &str| Err(Refusal::new(format!("--denoise {why}")).at(scene.path.display()).into());
    if scene.picture != Some(LayerSpec::Radiance) {
        return refused(
            "takes away the noise of light, and the picture shows none\nhint: give the scene a `tracer` of light, \
             such as {\"type\": \"path\"}, or leave it out",
        );
    }
    if has_spectrum(scene) {
        return refused(
            "knows red, green and blue alone, and camera.sensor is `multispectral`: its bands would keep \
             their noise\nhint: leave it out",
        );
    }
    for layer in [LayerSpec::MeanAlbedo, LayerSpec::MeanNormal] {
        if !scene.layers.contains(&layer) {
            scene.layers.push(layer);
        }
    }
    Ok(())
}

/// `picture` with the layer [`DENOISED`] beside its own light, guided by its layers of mean albedo and
/// normals where it has both.
///
/// # Errors
///
/// When it has no light in red, green and blue, there is too little memory, or the library fails.
pub fn denoised(picture: Picture, denoiser: &Denoiser) -> Result<Picture, RenderError> {
    let size = [picture.width(), picture.height()];
    let light = picture.layer("").and_then(woven).transpose()?;
    let mut light = light.ok_or_else(|| {
        Refusal::new("the picture is no light in red, green and blue").at("--denoise")
    })?;
    let guide = |spec: LayerSpec| picture.layer(&spec.row().name).and_then(woven).transpose();
    let guides = match (guide(LayerSpec::MeanAlbedo)?, guide(LayerSpec::MeanNormal)?) {
        (Some(mut albedo), Some(normal)) => {
            // A lens lets more through in some places than where its weights are 1.
            albedo.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
            Some(Guides { albedo, normal })
        }
        _ => None,
    };
    denoiser.denoise(size, &mut light, guides)?;
    let layer = layer(&light, denoiser.version())?;
    let (names, development) = (picture.all_names().to_vec(), *picture.development());
    let header = picture.header().iter().cloned().chain([fingerprint()]).collect();
    let layers = picture.into_layers().into_iter().chain([layer]).collect();
    let picture = Picture::new(size[0], size[1], layers, header)?;
    Ok(picture.with_names(names).developed(development))
}

/// The values of a layer of three channels in f32, pixel by pixel; `None` for other layers.
fn woven(layer: &Layer) -> Option<Result<Vec<f32>, NoMemory>> {
    let planes = three_planes(layer)?;
    Some(filled(0.0, 3 * planes[0].len()).map(|mut values| {
        for (i, pixel) in values.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = planes.map(|plane| plane[i]);
        }
        values
    }))
}

/// The layer of `light`, pixel by pixel.
fn layer(light: &[f32], version: &str) -> Result<Layer, NoMemory> {
    let pixels = light.as_chunks::<3>().0;
    let channel = |(k, name): (usize, &str)| {
        let mut values = filled(0.0, pixels.len())?;
        values.iter_mut().zip(pixels).for_each(|(value, pixel)| *value = pixel[k]);
        Ok(Channel { name: name.to_owned(), values: Values::F32(values) })
    };
    let by = format!("Intel Open Image Denoise {version}");
    let meaning = [
        (
            "definition",
            "the picture less most of its noise, as a neural network sees it that is guided by MeanAlbedo \
             and MeanNormal: to look at, not a measurement; it has a bias that nobody knows, and values \
             below 0 went in as 0",
        ),
        ("unit", "1 (linear light, sRGB primaries)"),
        ("by", &by),
        ("shown by", "picture.png"),
    ];
    Ok(Layer {
        name: DENOISED.to_owned(),
        look: Look::Color,
        channels: ["R", "G", "B"].into_iter().enumerate().map(channel).collect::<Result<_, _>>()?,
        meaning: meaning.map(|(key, text)| HeaderEntry::new(key, text)).into(),
    })
}
