use super::*;

const HEADER: &str = "ENVI\ndescription = {\n two lines}\nsamples = 3\nlines = 2\nbands = 2\n; a comment\n\
    header offset = 0\nfile type = ENVI Standard\ndata type = 4\ninterleave = bsq\nbyte order = 0\n\
    wavelength units = Nanometers\nwavelength = {450,\n 550}\n";

/// Value 100·row + 10·column + band of each pixel and band.
fn numbers(interleave: &str) -> Vec<f64> {
    let value = |row: usize, column: usize, band: usize| (100 * row + 10 * column + band) as f64;
    let mut all = Vec::new();
    for (a, b, c) in (0..12).map(|i| match interleave {
        "bsq" => (i / 3 % 2, i % 3, i / 6),
        "bil" => (i / 6, i % 3, i / 3 % 2),
        _ => (i / 6, i / 2 % 3, i % 2),
    }) {
        all.push(value(a, b, c));
    }
    all
}

fn decode(header: &str, data: &[u8]) -> Result<Cube, String> {
    let header = Header::parse(header.as_bytes()).map_err(|error| error.to_string())?;
    header.decode(data, Limits::default()).map_err(|error| error.to_string())
}

#[test]
fn all_orders_kinds_and_byte_orders_are_one_cube() {
    let expected: Vec<f32> = numbers("bip").into_iter().map(|v| v as f32).collect();
    type ToBytes = fn(f64) -> Vec<u8>;
    let kinds: [(u32, ToBytes); 9] = [
        (1, |v| (v as u8).to_le_bytes().into()),
        (2, |v| (v as i16).to_le_bytes().into()),
        (12, |v| (v as u16).to_le_bytes().into()),
        (3, |v| (v as i32).to_le_bytes().into()),
        (13, |v| (v as u32).to_le_bytes().into()),
        (14, |v| (v as i64).to_le_bytes().into()),
        (15, |v| (v as u64).to_le_bytes().into()),
        (4, |v| (v as f32).to_le_bytes().into()),
        (5, |v| v.to_le_bytes().into()),
    ];
    for interleave in ["bsq", "bil", "bip"] {
        for (code, bytes) in kinds {
            for order in [0, 1] {
                let each = |v| {
                    let mut bytes = bytes(v);
                    if order == 1 {
                        bytes.reverse();
                    }
                    bytes
                };
                let data: Vec<u8> = numbers(interleave).into_iter().flat_map(each).collect();
                let header = HEADER
                    .replace("= bsq", &format!("= {}", interleave.to_uppercase()))
                    .replace("data type = 4", &format!("data type = {code}"))
                    .replace("byte order = 0", &format!("byte order = {order}"))
                    .replace("offset = 0", "offset = 5");
                let cube = decode(&header, &[&[9; 5][..], &data].concat()).unwrap();
                assert_eq!(cube.values, expected, "{interleave} {code} {order}");
                assert_eq!((cube.size, cube.axis.wavelengths()), ([3, 2], &[450.0, 550.0][..]));
            }
        }
    }
}

#[test]
fn gains_offsets_missing_numbers_bad_bands_and_units_are_heeded() {
    let data: Vec<u8> = numbers("bsq").into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect();
    let more = "data gain values = {2, 3}\ndata offset values = {1, 0.5}\ndata ignore value = 10\n\
        fwhm = {100, 100}\nz plot titles = {Wavelength (nm), Radiance (W/(m^2 sr nm))}\n";
    let cube = decode(&(HEADER.to_owned() + more), &data).unwrap();
    assert_eq!(cube.values[..2], [1.0, 3.5]);
    // A number that f32 rounds, in the place of the first.
    for missing in ["1e20", "0.1", "-1e-5", "3.4028235e38"] {
        let mut data = data.clone();
        data[..4].copy_from_slice(&missing.parse::<f32>().unwrap().to_le_bytes());
        let header = format!("{HEADER}data ignore value = {missing}\n");
        let cube = decode(&header, &data).unwrap();
        assert!(cube.values[0].is_nan() && cube.values[1].is_finite(), "{missing}");
    }
    assert!(cube.values[2].is_nan() && cube.values[3] == 33.5, "{:?}", cube.values);
    assert_eq!(cube.axis.edges(), [400.0, 500.0, 600.0]);
    assert_eq!(cube.unit.as_deref(), Some("W/(m^2 sr nm)"));
    assert!(cube.notes[0].contains("1 numbers are its `data ignore value`"), "{:?}", cube.notes);
    let bad =
        HEADER.replace("bands = 2", "bands = 3").replace("550}", "550, 650}") + "bbl = {1, 0, 1}\n";
    let cube = decode(&bad, &[0; 72]).unwrap();
    assert_eq!((cube.axis.wavelengths(), cube.values.len()), (&[450.0, 650.0][..], 12));
    let share = decode(&(HEADER.to_owned() + "reflectance scale factor = 10000\n"), &data).unwrap();
    assert_eq!(share.quantity, Quantity::Reflectance);
    assert_eq!(share.values[11], 121.0 / 1e4, "{:?}", share.values);
    for bad in ["0", "-1", "nan", "white"] {
        let why = decode(&format!("{HEADER}reflectance scale factor = {bad}\n"), &data);
        assert!(why.unwrap_err().contains("`reflectance scale factor`"), "{bad}");
    }
    let micro =
        HEADER.replace("Nanometers", "Micrometers").replace("450", "0.45").replace("550", ".55");
    let cube = decode(&(micro + "fwhm = {0.1, 0.1}\n"), &data).unwrap();
    assert_eq!(cube.axis.edges(), [400.0, 500.0, 600.0]);
}

#[test]
fn headers_that_make_no_sense_are_refused_by_their_key() {
    let data = [0; 48];
    for (from, to, word) in [
        ("ENVI", "ENVY", "first line"),
        ("samples = 3", "samples = 0", "`samples` of nothing"),
        ("samples = 3", "samples = three", "`samples = three`"),
        ("samples = 3\n", "", "does not say `samples`"),
        (
            "lines = 2",
            "lines = 3",
            "promises 3 samples x 3 lines x 2 bands of 4 bytes behind the first 0",
        ),
        ("lines = 2", "lines = 18446744073709551615", "promises 3 samples"),
        ("offset = 0", "offset = 1", "48 bytes: it is cut off"),
        ("= bsq", "= bsp", "known: bsq, bil, bip"),
        ("interleave = bsq\n", "", "does not say `interleave`"),
        ("data type = 4", "data type = 6", "complex"),
        ("data type = 4", "data type = 7", "`data type = 7`"),
        ("byte order = 0", "byte order = 2", "`byte order = 2`"),
        ("byte order = 0\n", "", "does not say `byte order`"),
        ("450,\n 550", "450", "1 numbers of `wavelength` and 2 bands"),
        ("450,\n 550", "450, blue", "\"blue\" among `wavelength`"),
        ("450,\n 550", "550, 450", "out of order"),
        ("450,\n 550", "450, 450", "two bands at 450 nm"),
        ("450,\n 550", "0.45, 0.55", "did you mean micrometres"),
        ("Nanometers", "GHz", "ghz, which is not read"),
        ("550}", "550", "never closed"),
        ("bands = 2", "bands = 2\nbands = 2", "twice, again in line 7"),
        ("bands = 2", "bands = 2\nwords", "line 7 without `=`"),
        ("bands = 2", "bands = 2\nfile compression = 1", "compressed"),
        ("bands = 2", "bands = 2\nbbl = {0, 0}", "no band"),
    ] {
        let header = HEADER.replacen(from, to, 1);
        assert_ne!(header, HEADER, "{from}");
        let why = decode(&header, &data).unwrap_err();
        assert!(why.contains(word), "{to}: {why}");
    }
    let without = decode(
        &HEADER.replace("wavelength units = Nanometers\n", "").replace("450", "0.45"),
        &data,
    );
    assert!(without.unwrap_err().contains("0.45 and does not say of what"));
}

#[test]
fn files_are_found_beside_one_another() {
    let names = |path: &str| {
        data_names(Path::new(path)).map(|p| p.display().to_string()).collect::<Vec<_>>()
    };
    assert_eq!(names("x/a.hdr")[..2], ["x/a.img", "x/a.dat"]);
    assert_eq!(names("x/a.hdr").last().unwrap(), "x/a");
    assert_eq!(names("a.img.hdr")[0], "a.img");
    assert!(is_data(Path::new("a.bil")) && !is_data(Path::new("a.exr")));
    let headers: Vec<PathBuf> = header_names(Path::new("a.img")).collect();
    assert_eq!((headers[0].to_str(), headers[2].to_str()), (Some("a.hdr"), Some("a.img.hdr")));
}
