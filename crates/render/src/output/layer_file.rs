//! The files that one layer leaves: which there are for which layers, their names, and what writes each.

use std::path::Path;

use super::conventions::{self, KITTI_DEPTH, TUM_DEPTH};
use super::png::Bits;
use super::{DENOISED, Look, OutputError, Outputs, Picture, SPECTRUM, envi, npy, png};
use etendue_files::Transaction;
use etendue_tracer::LayerSpec;

/// A file of one layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LayerFile {
    /// To look at.
    Preview,
    /// Numbers of things as 16-bit PNG.
    Mask,
    /// For numpy.
    Array,
    /// Depth of the TUM RGB-D benchmark.
    TumDepth,
    /// Depth of KITTI.
    KittiDepth,
    /// Disparity of KITTI.
    KittiDisparity,
    /// Flow of KITTI.
    KittiFlow,
    /// Flow of the Middlebury benchmark.
    Flo,
    /// Numbers of things as indices of a palette.
    Indexed,
    /// Header of an ENVI cube, which says what its numbers are.
    EnviHeader,
    /// The numbers of an ENVI cube.
    EnviNumbers,
}

impl LayerFile {
    /// Those of the layer called `layer` (empty for the picture itself) among `outputs`, in the order in which
    /// they are written.
    pub fn of(layer: &str, outputs: Outputs) -> impl Iterator<Item = Self> {
        let spec = LayerSpec::from_file_name(layer);
        let is_depth = spec == Some(LayerSpec::Depth);
        let is_disparity = matches!(spec, Some(LayerSpec::Disparity { .. }));
        let is_flow = matches!(spec, Some(LayerSpec::Flow { .. }));
        let named = has_mask(layer);
        let all = [
            // The picture's own shows what is denoised.
            (outputs.png && layer != DENOISED, Self::Preview),
            (outputs.png && named, Self::Mask),
            (outputs.npy, Self::Array),
            (outputs.tum && is_depth, Self::TumDepth),
            (outputs.kitti && is_depth, Self::KittiDepth),
            (outputs.kitti && is_disparity, Self::KittiDisparity),
            (outputs.kitti && is_flow, Self::KittiFlow),
            (outputs.flo && is_flow, Self::Flo),
            (outputs.indexed && named, Self::Indexed),
            (outputs.envi && layer == SPECTRUM, Self::EnviHeader),
            (outputs.envi && layer == SPECTRUM, Self::EnviNumbers),
        ];
        all.into_iter().filter_map(|(wanted, file)| wanted.then_some(file))
    }

    /// Kind of file among `outputs` that none of `layers` is written as: the word for it, and the layers that are.
    #[must_use]
    pub fn without_layer(outputs: Outputs, layers: &[String]) -> Option<[&'static str; 2]> {
        let none = Outputs::NONE;
        let all = [
            (Outputs { tum: outputs.tum, ..none }, ["tum", "depth"]),
            (Outputs { kitti: outputs.kitti, ..none }, ["kitti", "depth, disparity or flow"]),
            (Outputs { flo: outputs.flo, ..none }, ["flo", "flow"]),
            (Outputs { indexed: outputs.indexed, ..none }, ["indexed", "ids or material_id"]),
            (Outputs { envi: outputs.envi, ..none }, ["envi", "light in bands"]),
        ];
        let lacks = |alone: Outputs| {
            alone != none && layers.iter().all(|name| Self::of(name, alone).next().is_none())
        };
        all.into_iter().find_map(|(alone, words)| lacks(alone).then_some(words))
    }

    /// Its name.
    #[must_use]
    pub fn name(self, layer: &str) -> String {
        let ending = match self {
            Self::Preview if layer.is_empty() => "png",
            Self::Preview => "preview.png",
            Self::Mask => "png",
            Self::Array => "npy",
            Self::TumDepth => "tum.png",
            Self::KittiDepth | Self::KittiDisparity | Self::KittiFlow => "kitti.png",
            Self::Flo => "flo",
            Self::Indexed => "indexed.png",
            Self::EnviHeader => "hdr",
            Self::EnviNumbers => "img",
        };
        format!("{}.{ending}", layer_stem(layer))
    }

    /// True if the file is written whatever the layer holds: numbers may be too large for masks.
    #[must_use]
    pub fn is_certain(self) -> bool {
        match self {
            Self::Mask | Self::Indexed => false,
            Self::Preview
            | Self::Array
            | Self::TumDepth
            | Self::KittiDepth
            | Self::KittiDisparity
            | Self::KittiFlow
            | Self::Flo
            | Self::EnviHeader
            | Self::EnviNumbers => true,
        }
    }

    /// A sentence on the hits of the layer called `name` that this file does not hold, where they are so many
    /// that it is told ([`crate::losses`]); none of a layer that there is not.
    #[must_use]
    pub fn note(self, picture: &Picture, name: &str) -> Option<String> {
        let layer = picture.layer(name)?;
        let (lost, range) = match self {
            // They show their range, or are exact.
            Self::Preview
            | Self::Mask
            | Self::Array
            | Self::Flo
            | Self::Indexed
            | Self::EnviHeader
            | Self::EnviNumbers => return None,
            Self::TumDepth => {
                let most = 65535.0 / TUM_DEPTH;
                let range = format!("0 to {most:.3} m, and are 0 in it");
                (conventions::lost_by_scaling(layer, TUM_DEPTH), range)
            }
            Self::KittiDepth | Self::KittiDisparity => {
                let most = 65535.0 / KITTI_DEPTH;
                let unit = if self == Self::KittiDepth { "m" } else { "pixels" };
                let range = format!("0 to {most:.3} {unit}, and are 0 in it");
                (conventions::lost_by_scaling(layer, KITTI_DEPTH), range)
            }
            Self::KittiFlow => {
                let range = "-512 to 512 pixels, and are unknown in it".to_owned();
                (conventions::lost_by_flow(layer), range)
            }
        };
        lost.is_clipped().then(|| {
            format!(
                "{}: {lost} of the hits are outside of what it holds, {range}; {}.npy and layers.exr have \
                 them (`--outputs npy,exr`)",
                self.name(name),
                layer_stem(name)
            )
        })
    }

    /// Writes the layer called `name` to `path`. `false` when its numbers do not fit into the format, and
    /// nothing is written.
    ///
    /// # Errors
    ///
    /// When there is no such layer, or the file cannot be written.
    pub fn write(
        self,
        files: &Transaction,
        path: &Path,
        picture: &Picture,
        name: &str,
    ) -> Result<bool, OutputError> {
        let layer = picture.require(name)?;
        match self {
            Self::Preview => {
                let bits = match layer.look {
                    Look::Distance => Bits::Sixteen,
                    Look::Color
                    | Look::Direction
                    | Look::Extent
                    | Look::Ids
                    | Look::Share
                    | Look::Cube
                    | Look::Counts { .. } => Bits::Eight,
                };
                png::write(files, path, picture, name, bits)?;
            }
            Self::Mask => return png::write_mask(files, path, picture, name),
            Self::Array => npy::write(files, path, picture, name)?,
            Self::TumDepth => {
                conventions::write_scaled(files, path, picture, layer, TUM_DEPTH, "metres")?;
            }
            Self::KittiDepth => {
                conventions::write_scaled(files, path, picture, layer, KITTI_DEPTH, "metres")?;
            }
            Self::KittiDisparity => {
                conventions::write_scaled(files, path, picture, layer, KITTI_DEPTH, "pixels")?;
            }
            Self::KittiFlow => conventions::write_flow(files, path, picture, layer)?,
            Self::Flo => conventions::write_flo(files, path, picture, layer)?,
            Self::Indexed => return conventions::write_indexed(files, path, picture, layer),
            Self::EnviHeader => envi::write_header(files, path, picture, name)?,
            Self::EnviNumbers => envi::write_numbers(files, path, picture, name)?,
        }
        Ok(true)
    }
}

/// True if a layer's numbers are worth a mask: names of things, and not the numbers of triangles.
pub(crate) fn has_mask(layer: &str) -> bool {
    let spec = LayerSpec::from_file_name(layer);
    spec.is_some_and(|spec| spec.row().look == Look::Ids) && !layer.ends_with(".primitive")
}

/// A layer's name as files have it: `NormalCamera` is `normal_camera`, `Id.object` `id_object`, the picture
/// `picture`.
#[must_use]
pub fn layer_stem(layer: &str) -> String {
    if layer.is_empty() {
        return "picture".to_owned();
    }
    let mut stem = String::new();
    for c in layer.replace('.', "_").chars() {
        if c.is_ascii_uppercase() && !stem.is_empty() {
            stem.push('_');
        }
        stem.push(c.to_ascii_lowercase());
    }
    stem
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_that_no_layer_serves_are_named() {
        let lacks = |list: &str, layers: &[&str]| {
            let layers: Vec<String> = layers.iter().map(|&name| name.to_owned()).collect();
            LayerFile::without_layer(Outputs::from_list(list).unwrap(), &layers)
                .map(|words| words[0])
        };
        // A depth that is the picture has no name.
        assert_eq!(lacks("png,tum", &["", "Normal"]), Some("tum"));
        assert_eq!(lacks("kitti,tum", &["Depth"]), None);
        assert_eq!(lacks("kitti,flo", &["Depth"]), Some("flo"));
        assert_eq!(lacks("indexed", &["Id.primitive"]), Some("indexed"));
        assert_eq!(lacks("envi", &["Depth"]), Some("envi"));
        assert_eq!(lacks("envi,npy", &["", "Spectrum"]), None);
        assert_eq!(lacks("exr,png,npy,dng", &[]), None);
    }

    #[test]
    fn names_are_those_of_layers_in_lower_case() {
        let files = |layer: &str, list: &str| {
            let files = LayerFile::of(layer, Outputs::from_list(list).unwrap());
            files.map(|file| file.name(layer)).collect::<Vec<_>>()
        };
        assert_eq!(files("", "exr,png,npy"), ["picture.png", "picture.npy"]);
        assert_eq!(files("NormalCamera", "png"), ["normal_camera.preview.png"]);
        let of_ids = ["id_object.preview.png", "id_object.png", "id_object.indexed.png"];
        assert_eq!(files("Id.object", "png,indexed"), of_ids);
        assert_eq!(files("Id.primitive", "png,indexed"), ["id_primitive.preview.png"]);
        assert_eq!(files(DENOISED, "png,npy"), ["denoised.npy"]);
        assert_eq!(files("Spectrum", "npy,envi"), ["spectrum.npy", "spectrum.hdr", "spectrum.img"]);
        assert_eq!(files("Depth", "envi").len(), 0);
    }
}
