# The words that README and CI use. Each may be run again at any time, and is quick when nothing changed.

# Reference data for tests, where it lies beside the checkout and nothing else was named.
ASSETS := $(shell cd ../shared 2>/dev/null && pwd)
ifneq ($(ASSETS),)
export ETENDUE_ASSETS ?= $(ASSETS)
endif

.PHONY: help setup render install view dist release portable-wheel test test-embree4 test-window test-slurm test-denoise test-aarch64 check-platforms python bench bench-peers bench-python bench-workers bench-light agreement bench-cycles bench-lens lens-waves bench-sensor bench-limits bench-sampling bench-forecast bench-memory bench-masks bench-diffraction bench-aspheres bench-bands bench-time bench-gaps bench-decisions bench-window docs-figures docs-charts \
	docs-stability docs-time docs-window generated gallery spectra light-fields fingerprints fuzz fuzz-smoke fuzz-seeds sanitize clean

help:
	@echo "make render        install what is missing, build, render scenes/first-light.json"
	@echo "make test          install what is missing, run everything that CI runs"
	@echo "make test-embree4  run the tests that touch Embree against Embree 4, in a Debian 13 root"
	@echo "make view          a window onto scenes/first-light.json; SCENE=… for another scene or model"
	@echo "make test-window   drive real windows on screens in memory: X11 (Xvfb) and Wayland (sway)"
	@echo "make test-slurm    run the jobs of scenes/cluster on a Slurm of one node, made for it"
	@echo "make test-denoise  run the tests of render --denoise with Open Image Denoise from PyPI"
	@echo "make test-aarch64  the pure-Rust renderer cross-built for ARM, and its tests under QEMU"
	@echo "make check-platforms  the pure-Rust renderer checked for macOS and Windows, linked for Windows, run by Wine"
	@echo "make python        build the Python package's wheel and test it in a fresh venv"
	@echo "make install       install the command below PREFIX, /usr/local when it is not given"
	@echo "make dist          a tarball, a .deb and a wheel in out/dist, tried in bare Debian 12 and 13 roots"
	@echo "make release       all that is published, tried: crates, those three, and a wheel for older systems"
	@echo "make portable-wheel  the wheel of the pure-Rust renderer, for systems with glibc 2.28 and newer"
	@echo "make bench         measure everything, write docs/measurements/benchmarks.md"
	@echo "make bench-peers   add other programs at the same job, from PyPI"
	@echo "make lens-waves    lenses in waves beside optiland, from PyPI"
	@echo "make bench-lens    time rays through a lens against optiland, from PyPI"
	@echo "make bench-python  rays from Python against Rust, Open3D and embreex; frames against their rays"
	@echo "make bench-workers  frames from Python by one worker process, by two and by sixteen"
	@echo "make bench-light   light against Mitsuba 3, from PyPI; writes docs/measurements/benchmarks-light.md"
	@echo "make agreement     pictures of light against Mitsuba 3's, from PyPI; writes docs/measurements/agreement.md"
	@echo "make bench-cycles  light against Blender's Cycles, from PyPI; writes docs/measurements/benchmarks-cycles.md"
	@echo "make bench-sensor  time one exposure against numpy, prysm and emva1288, from PyPI"
	@echo "make bench-limits  scenes and pictures as large as most machines take; writes docs/measurements/limits.md"
	@echo "make bench-sampling  what samples that stop save, and what an oracle would; writes docs/measurements/sampling.md"
	@echo "make bench-forecast  render the example scenes, and hold the forecast of time against it"
	@echo "make bench-memory   the same for the forecast of memory, and for copies, large shapes and frames"
	@echo "make bench-masks   what a ray through a mask of small openings costs; writes a part of docs/measurements/costs.md"
	@echo "make bench-diffraction  what waves in the picture cost beside rays; writes a part of docs/measurements/costs.md"
	@echo "make bench-aspheres  what setting a camera up behind steep aspheres takes; writes a part of docs/measurements/limits.md"
	@echo "make bench-bands   what bands cost beside RGB, and a lens that disperses; writes parts of docs/measurements/costs.md"
	@echo "make bench-time    what shutters, moving cameras, copies and shapes cost; writes a part of docs/measurements/costs.md"
	@echo "make bench-gaps    what finding the thinnest gap of a million triangles takes; writes a part of docs/measurements/costs.md"
	@echo "make bench-window  how soon and how often the window shows pictures; writes a part of docs/measurements/costs.md"
	@echo "make bench-decisions  what decisions of the plan save, each against the fuller model, and what overriding it by hand would"
	@echo "make generated     schemas, tables of keys, presets and layers, the pages of the command line and of the Python package, as these write them"
	@echo "make gallery       render the pictures of docs/guide/gallery.md, and write there what they took"
	@echo "make docs-figures  render the pictures of the documents anew, into docs/images"
	@echo "make docs-window   screenshots of six states of the window, into docs/images/window"
	@echo "make docs-time     render the pictures of docs/how-to/time.md anew"
	@echo "make spectra       the pictures of docs/explanation/spectra.md, and what they lose by colours of three numbers"
	@echo "make light-fields  the walk of docs/how-to/light-fields.md in a venv, its pictures, and another decoder's opinion"
	@echo "make docs-charts   measure docs/measurements/speed-and-accuracy.md anew, with its charts"
	@echo "make docs-stability  take every method to where it fails, at full scale, write docs/measurements/stability.md"
	@echo "make fingerprints  fingerprints of pictures, sensor images and lens tables, to move code without changing them"
	@echo "make fuzz-smoke    changed inputs for every reader of files, a minute each"
	@echo "make fuzz          an hour of coverage-guided fuzzing, which cargo-fuzz and a nightly compiler take"
	@echo "make fuzz-seeds    write the inputs that cargo-fuzz starts from into fuzz/corpus"
	@echo "make sanitize      the accelerator in pure Rust under the address sanitizer (a nightly compiler)"
	@echo "make clean         remove target/ and out/"

setup:
	@scripts/setup.sh

render: setup
	cargo run --release -p etendue-cli -- render scenes/first-light.json -o out/first-light
	@echo "The files are in $(CURDIR)/out/first-light:"
	@ls -lh out/first-light

SCENE := scenes/first-light.json

view: setup
	cargo run --release -p etendue-cli --features window -- view $(SCENE)

test-window:
	@scripts/setup.sh test
	@scripts/window.sh x11 states wayland

test:
	@scripts/setup.sh test
	@scripts/test.sh

# ARGS="-E 'test(spheres)'" chooses tests, as cargo nextest does.
test-aarch64: setup
	cargo build -p etendue-cli
	scripts/test-aarch64.sh $(ARGS)

check-platforms: setup
	cargo build -p etendue-cli
	scripts/check-platforms.sh $(ARGS)

# The wheel, in out/python/wheels, tested in a fresh venv. PROFILE=dev is quick to build and slow to run.
python: setup
	@scripts/python.sh

PREFIX ?= /usr/local

# DESTDIR goes before PREFIX, as packagers want it.
install: setup
	cargo build --release --locked -p etendue-cli
	install -D -s -m 755 target/release/etendue "$(DESTDIR)$(PREFIX)/bin/etendue"
	scripts/share.sh target/release/etendue "$(DESTDIR)$(PREFIX)/share"

dist: setup
	@scripts/dist.sh

# Everything that is published, and tried: see scripts/release.sh. NO_VERIFY=1 packs the crates without building each.
release: setup
	@scripts/release.sh

# The wheel of the pure-Rust renderer for glibc 2.28 and newer.
portable-wheel: setup
	@scripts/portable-wheel.sh

test-embree4: setup
	@scripts/test-embree4.sh

test-denoise: setup
	@scripts/setup.sh test
	ETENDUE_OIDN="$$(scripts/oidn.sh)" cargo test -p etendue-cli --test cli denoise

test-slurm: setup
	@scripts/test-slurm.sh

# ARGS=--quick takes lighter meshes; benches of single questions: cargo bench -p etendue-benches
bench: setup
	cargo build --release -p etendue-cli -p etendue-benches
	cargo run --release -p etendue-benches --bin benchmarks -- $(ARGS)

bench-peers: setup
	cargo build --release -p etendue-cli -p etendue-benches
	scripts/bench-peers.sh peers.py $(ARGS)

# Of the wheel that `make python` made last.
bench-python: setup
	cargo build --release -p etendue-benches
	scripts/bench-peers.sh python_peers.py $(ARGS)

# Of the wheel that `make python` made last, on a machine with nothing else to do.
bench-workers:
	out/python/venv/bin/python benches/workers.py --output docs/measurements/benchmarks-python.md $(ARGS)

bench-light: setup
	cargo build --release -p etendue-cli -p etendue-benches --bin etendue --bin benchmarks
	scripts/bench-peers.sh light_peers.py $(ARGS)

# Fails where pictures differ by more than their noise. ARGS='--scenes "mirror"' compares some of them.
agreement: setup
	cargo build --release -p etendue-cli -p etendue-benches
	scripts/bench-peers.sh light_agreement.py $(ARGS)

bench-cycles: setup
	cargo build --release -p etendue-cli -p etendue-benches
	scripts/bench-peers.sh cycles_peers.py $(ARGS)

bench-lens:
	cargo build --release -p etendue-optics --example trace_lens
	scripts/bench-peers.sh lens_peers.py $(ARGS)

lens-waves:
	cargo build --release -p etendue-cli --no-default-features
	scripts/bench-peers.sh lens_waves.py $(ARGS)

bench-sensor:
	cargo build --release -p etendue-sensor --example expose_frame
	scripts/bench-peers.sh sensor_peers.py $(ARGS)

bench-limits: setup
	cargo build --release -p etendue-cli -p etendue-benches
	python3 benches/limits.py $(ARGS)

bench-sampling: setup
	cargo run --release -p etendue-benches --bin sampling -- $(ARGS)

# What was forecast of the example scenes, and what they took. ARGS are those of benches/forecasts.py.
bench-forecast: setup
	cargo build --release -p etendue-cli
	python3 benches/forecasts.py time $(ARGS)

bench-memory: setup
	cargo build --release -p etendue-cli
	python3 benches/forecasts.py memory $(ARGS)

# The tables of benches/costs.py, by their names.
bench-masks bench-diffraction bench-aspheres bench-bands: setup
	cargo build --release -p etendue-cli
	python3 benches/costs.py $(@:bench-%=%) $(ARGS)

bench-time bench-gaps: setup
	cargo build --release -p etendue-cli -p etendue-benches
	python3 benches/costs.py $(@:bench-%=%) $(ARGS)

bench-decisions: setup
	cargo build --release -p etendue-cli
	python3 benches/decisions.py $(ARGS)

# With ETENDUE_ASSETS also on a textured model of the reference data.
bench-window:
	@scripts/setup.sh test
	cargo build --release -p etendue-cli --features window
	python3 benches/window.py $(ARGS)

# ARGS=--quick takes lighter meshes
docs-charts: setup
	cargo run --release -p etendue-benches --bin charts -- $(ARGS)

docs-figures: setup docs-charts docs-stability light-fields gallery spectra
	cargo run --release -p etendue-cli -- render scenes/first-light.json -o out/docs-figures \
		--set 'camera.sensor.resolution=[640,640]' --samples 16 --outputs png
	install -D -m 644 out/docs-figures/picture.png docs/images/first-light.png
	cargo run --release -p etendue-cli -- render scenes/sensor-noise.json -o out/docs-figures/sampling --outputs png
	install -D -m 644 out/docs-figures/sampling/raw.preview.png docs/images/sampling/sensor-noise.png
	install -D -m 644 out/docs-figures/sampling/sample_count.preview.png docs/images/sampling/sensor-noise-map.png
	cargo run --release -p etendue-sensor --example approximation -- docs/images/normal-approximation.svg
	$(MAKE) docs-time

# The pictures of docs/how-to/time.md; COMMAND names another build than the release one.
COMMAND ?= cargo run --release -p etendue-cli --
docs-time:
	for scene in moving rolling flicker serial pose; do \
		$(COMMAND) render scenes/time/$$scene.json -o out/docs-figures/time --samples 256 --outputs png && \
		install -D -m 644 out/docs-figures/time/picture.png docs/images/time/$$scene.png || exit 1; \
	done
	for moment in 0.001 0.049 0.0966; do \
		$(COMMAND) render scenes/time/pose.json -o out/docs-figures/time --samples 256 --outputs png \
			--set camera.shutter=null --set render.time=$$moment && \
		install -D -m 644 out/docs-figures/time/picture.png docs/images/time/pose-$$moment.png || exit 1; \
	done

# What the program writes into the repository, which the tests hold against it: schema/, docs/reference/keys.md,
# docs/reference/command-line.md.
generated: setup
	ETENDUE_GENERATE=1 cargo test -p etendue-cli --test cli generated::
	python3 scripts/python_api.py

# The commands of docs/guide/gallery.md, their pictures and their times. ARGS="prism burst" takes some sections, ARGS=--noise
# measures what noise the denoised pictures have.
gallery: setup
	cargo build --release -p etendue-cli
	ETENDUE_OIDN="$$(scripts/oidn.sh)" python3 benches/gallery.py $(ARGS)

# The pictures of docs/explanation/spectra.md and the gallery's chart, and their colour errors.
spectra: setup
	cargo build --release -p etendue-cli
	python3 benches/spectra.py

# The pictures of docs/reference/window.md: six states, as their test reaches them.
docs-window:
	@scripts/setup.sh test
	RESOLUTION=[480,320] SAMPLES=4 scripts/window.sh states
	install -D -m 644 -t docs/images/window $(foreach state,start broken heavy layers remove sensor,out/window/state-$(state).png)

# The Python of docs/how-to/light-fields.md and its pictures, and plenopticam's views against ours. ARGS go to the render.
light-fields: setup
	@scripts/light-fields.sh $(ARGS)

# Every reader of files under changed inputs, each for a minute: ARGS="--seconds 600 obj ply" for more
# of fewer. What fails is kept in out/fuzz.
fuzz-smoke: setup
	cargo build -p etendue-fuzz
	target/debug/fuzz-smoke $(ARGS)

# An hour of processor time, divided among all readers: ARGS="--minutes 10 glb texture" for less of fewer,
# ARGS="--page docs/measurements/limits.md" to write the table there. What fails is kept in out/fuzz-guided.
fuzz: setup
	python3 scripts/fuzz.py $(ARGS)

# The seeds for `cargo +nightly fuzz run TARGET`, in fuzz/corpus.
fuzz-seeds: setup
	cargo run -p etendue-fuzz -- --write-seeds fuzz/corpus

# A few minutes: every case of tests/stability at full scale.
docs-stability: setup
	cargo run --release -p etendue-stability -- $(ARGS)

# BASE=path/to/another/etendue compares the two and fails where they differ.
fingerprints: setup
	cargo build --release -p etendue-cli
	scripts/fingerprints.sh target/release/etendue $(BASE)

# The tests of the pure-Rust tree, which has no unsafe code of its own, with every access to memory checked.
sanitize:
	EMBREE_DIR=/nonexistent RUSTFLAGS=-Zsanitizer=address cargo +nightly test -p etendue-accel \
		--no-default-features --tests --target $(shell rustc -vV | sed -n 's/host: //p') --target-dir target/sanitize

clean:
	rm -rf target out
