use image::{ExtendedColorType, ImageEncoder};

use super::*;

fn png(values: &[u8], size: [u32; 2], color: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder.write_image(values, size[0], size[1], color).unwrap();
    bytes
}

/// A Radiance file of one texel without run lengths.
fn hdr(header: &str, texel: [u8; 4]) -> Vec<u8> {
    let mut bytes = format!("{header}\n\n-Y 1 +X 1\n").into_bytes();
    bytes.extend(texel);
    bytes
}

fn only(bytes: &[u8]) -> [f64; 4] {
    let raster = decode(bytes, Limits::default()).unwrap();
    assert_eq!(raster.size(), [1, 1]);
    raster.texel(0)
}

#[test]
fn values_stay_as_the_file_has_them() {
    let deep = [0x12, 0x34, 0xff, 0xfe, 0x00, 0x01].map(|b: u8| b);
    let bytes =
        png(bytemuck::cast_slice(&[0x1234_u16, 0xfffe, 1]), [1, 1], ExtendedColorType::Rgb16);
    let raster = decode(&bytes, Limits::default()).unwrap();
    assert_eq!((raster.bytes(), raster.channels()), (deep.len(), 3));
    let expected = [0x1234, 0xfffe, 1].map(|v| f64::from(v) / 65_535.0);
    assert_eq!(raster.texel(0)[..3], expected);
    let linear = raster.linear(0);
    for (own, expected) in linear.iter().zip(expected) {
        assert!((own - linear_from_srgb(expected)).abs() < 1e-15);
    }
    let grey = decode(&png(&[51, 128], [1, 1], ExtendedColorType::La8), Limits::default()).unwrap();
    assert_eq!(grey.texel(0), [0.2, 0.2, 0.2, 128.0 / 255.0]);
    assert_eq!(grey.linear(0)[3], 128.0 / 255.0, "alpha has no curve");
}

#[test]
fn radiance_files_of_any_program_are_divided_by_their_exposures() {
    // 2^(136-136) = 1 times the mantissas over 1: Ward's formula without its half.
    let texel = [64, 128, 32, 136];
    let plain = only(&hdr("#?RADIANCE\nFORMAT=32-bit_rle_rgbe", texel));
    assert_eq!(plain[..3], [64.0, 128.0, 32.0]);
    assert_eq!(only(&hdr("#?RGBE\nFORMAT=32-bit_rle_rgbe", texel)), plain);
    let exposed = hdr("#?RGBE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\nEXPOSURE= 4", texel);
    assert_eq!(only(&exposed)[..3], [8.0, 16.0, 4.0]);
    let corrected = hdr("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nCOLORCORR=1 2 4", texel);
    assert_eq!(only(&corrected)[..3], [64.0, 64.0, 8.0]);
    for (line, why) in [("EXPOSURE=0", "EXPOSURE 0"), ("FORMAT=32-bit_rle_xyze", "xyze")] {
        let error = decode(&hdr(&format!("#?RADIANCE\n{line}"), texel), Limits::default());
        let message = error.unwrap_err().to_string();
        assert!(message.contains(why), "{message}");
    }
}

#[test]
fn exr_files_of_one_channel_are_grey_and_halves_are_packed() {
    let folder = std::env::temp_dir();
    for (name, own) in [("Y", 0.25_f32), ("mask", 3.0), ("Y", 0.1)] {
        let path = folder.join(format!("etendue-image-{name}-{own}-{}.exr", std::process::id()));
        let channels =
            exr::prelude::SpecificChannels::build().with_channel(name).with_pixel_fn(|_| (own,));
        let image = exr::prelude::Image::from_channels((2, 3), channels);
        exr::prelude::WritableImage::write(&image).to_file(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let raster = decode(&bytes, Limits::default()).unwrap().packed();
        let value = f64::from(own);
        assert_eq!((raster.size(), raster.texel(5)), ([2, 3], [value, value, value, 1.0]));
        // A tenth is no half; the others are.
        assert_eq!(raster.bytes(), if own == 0.1 { 24 } else { 12 });
        let small = decode(&bytes, Limits::within(Some(23)));
        assert!(matches!(small, Err(DecodeError::Size { bytes: 24, .. })), "{small:?}");
    }
}

#[test]
fn a_jpeg_without_its_end_is_refused() {
    let texels: Vec<u8> = (0..64 * 64 * 3).map(|k| u8::try_from(k * 7 % 251).unwrap()).collect();
    let mut whole = Vec::new();
    image::codecs::jpeg::JpegEncoder::new(&mut whole)
        .write_image(&texels, 64, 64, ExtendedColorType::Rgb8)
        .unwrap();
    assert!(decode(&whole, Limits::default()).is_ok());
    // What cameras append, and a thumbnail with an end of its own in a segment before.
    assert!(decode(&[&whole[..], b"more"].concat(), Limits::default()).is_ok());
    let thumbnail = [&whole[..2], b"\xff\xe1\x00\x06\xff\xd8\xff\xd9", &whole[2..]].concat();
    assert!(decode(&thumbnail, Limits::default()).is_ok());
    for whole in [whole, thumbnail] {
        for length in [whole.len() - 2, whole.len() - 1, whole.len() / 2, 300] {
            let cut = decode(&whole[..length], Limits::default());
            assert!(matches!(cut, Err(DecodeError::Cut)), "{length}: {cut:?}");
        }
    }
}

#[test]
fn sizes_are_judged_before_anything_is_decoded() {
    // A header alone: were it decoded, the error would be another.
    let header = |side: u32| {
        let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
        bytes.extend(side.to_be_bytes());
        bytes.extend(side.to_be_bytes());
        bytes.extend([8, 2, 0, 0, 0]);
        let crc = crc(&bytes[12..]);
        bytes.extend(crc.to_be_bytes());
        bytes.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
        bytes
    };
    let message = |side| decode(&header(side), Limits::default()).unwrap_err().to_string();
    let large = message(32_768);
    assert!(large.contains("32768 x 32768 texels, which take 3.22 GB"), "{large}");
    assert!(message(40_000).contains("32768 a side"), "{}", message(40_000));
    // What fits, but not into so few bytes, whatever the compression.
    let made_of_nothing = message(16_384);
    let words = "which take 0.81 GB decoded, out of all proportion to the 45 bytes";
    assert!(made_of_nothing.contains(words), "{made_of_nothing}");
    let limited = decode(&header(1_024), Limits::within(Some(3 << 20))).unwrap_err();
    assert!(!matches!(limited, DecodeError::Size { .. }), "{limited}");
    let limited = decode(&header(1_024), Limits::within(Some((3 << 20) - 1))).unwrap_err();
    assert!(limited.to_string().contains("--memory-limit"), "{limited}");
    for bytes in [&b""[..], b"no image", b"#?RADIANCE", &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]] {
        assert!(decode(bytes, Limits::default()).is_err(), "{bytes:?}");
    }
}

/// PNG's checksum (ISO/IEC 15948, annex D).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg()))
    })
}
