//! Part of an image that is read out, and its packing.

use etendue_sensor::{InvalidValues, Packing, RawImage, Sensor, SensorSpec, Window};

fn numbers(width: usize, values: Vec<u16>) -> RawImage {
    let height = values.len() / width;
    RawImage { width, height, depth: 1, values, invalid: InvalidValues::default() }
}

#[test]
fn numbers_are_packed_as_the_kernel_says() {
    // Four pixels of 0b11_1111_1101 down to _00: the fifth byte has the low bits, the first pixel's lowest.
    let four = numbers(4, vec![0x3FD, 0x0FE, 0x001, 0x203]);
    assert_eq!(Packing::Raw10.pack(&four).unwrap(), [0xFF, 0x3F, 0x00, 0x80, 0b11_01_10_01]);
    let two = numbers(2, vec![0xABC, 0x123]);
    assert_eq!(Packing::Raw12.pack(&two).unwrap(), [0xAB, 0x12, 0x3C]);
    for (packing, most) in [(Packing::Raw10, 1024), (Packing::Raw12, 4096)] {
        let all: Vec<u16> = (0..most).map(|k: u16| k.wrapping_mul(77) % most).collect();
        let packed = packing.pack(&numbers(16, all.clone())).unwrap();
        assert_eq!(packed.len() * 8, all.len() * packing.bits() as usize);
        assert_eq!(packing.unpack(&packed), all);
    }
}

#[test]
fn what_does_not_divide_or_fit_is_refused() {
    for (packing, width, value, word) in [
        (Packing::Raw10, 6, 1, "four divide"),
        (Packing::Raw12, 3, 1, "even width"),
        (Packing::Raw10, 4, 1024, "10 bits at most"),
        (Packing::Raw12, 2, 4096, "12 bits at most"),
    ] {
        let error = packing.pack(&numbers(width, vec![value; width * 2])).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

fn sensor(cfa: Option<&str>) -> Sensor {
    let mut spec = serde_json::json!({ "type": "raw", "resolution": [8, 4] });
    if let Some(cfa) = cfa {
        spec["cfa"] = cfa.into();
    }
    Sensor::new(&serde_json::from_value::<SensorSpec>(spec).unwrap()).unwrap()
}

fn image() -> RawImage {
    let values = (0..32).map(|at| at / 8 * 100 + at % 8).collect();
    RawImage { width: 8, height: 4, depth: 1, values, invalid: InvalidValues::default() }
}

fn window(
    cfa: Option<&str>,
    region: Option<[usize; 4]>,
    binning: usize,
) -> Result<Vec<u16>, String> {
    let found = sensor(cfa).window(&image(), Window { region, binning });
    found.map(|image| image.values).map_err(|error| error.to_string())
}

#[test]
fn pixels_of_one_colour_are_averaged() {
    assert_eq!(window(None, Some([2, 1, 3, 2]), 1).unwrap(), [102, 103, 104, 202, 203, 204]);
    // Means of 0 1 100 101, and so on: halves to even.
    assert_eq!(window(None, None, 2).unwrap(), [50, 52, 54, 56, 250, 252, 254, 256]);
    // Of a mosaic 0 2 200 202, 1 3 201 203, and the next tile's.
    assert_eq!(window(Some("rggb"), None, 2).unwrap(), [101, 102, 105, 106, 201, 202, 205, 206]);
    assert_eq!(window(Some("rggb"), Some([4, 0, 4, 4]), 2).unwrap(), [105, 106, 205, 206]);
}

#[test]
fn windows_that_are_none_are_refused() {
    for (cfa, region, binning, word) in [
        (
            None,
            Some([6, 0, 3, 1]),
            1,
            "sensor.region: expected columns of the chip, one at least, found 9",
        ),
        (None, Some([0, 4, 1, 1]), 1, "rows of the chip, one at least, found 5"),
        (None, Some([0, 0, 0, 1]), 1, "one at least"),
        (None, Some([usize::MAX, 0, 2, 1]), 1, "columns of the chip"),
        (Some("rggb"), Some([1, 0, 2, 2]), 1, "where a tile of filters begins, found 1"),
        (None, None, 3, "sensor.binning: expected a width that divides"),
        (Some("rggb"), Some([0, 0, 6, 4]), 2, "a width that divides"),
        (None, None, 0, "1 to 64 pixels"),
    ] {
        let why = window(cfa, region, binning).unwrap_err();
        assert!(why.contains(word), "{why}");
    }
}
