"""A second opinion: plenopticam 0.9.3 cuts the raw picture of FOLDER into views at the lenslets' centres of
geometry.json, and its views are compared with the reference views. Square grids."""

import json
import sys
import tempfile
import types
import warnings

import numpy as np

warnings.filterwarnings("ignore")


class Absent(types.ModuleType):
    """A module that is imported and never used."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Absent(name)


for name in ["depthy", "depthy.misc", "depthy.lightfield", "depthy.lightfield.epi_depth"]:
    sys.modules[name] = Absent(name)
for name in ["color_matcher", "color_matcher.top_level"]:
    sys.modules[name] = Absent(name)

from plenopticam.cfg import PlenopticamConfig  # noqa: E402
from plenopticam.lfp_aligner import LfpAligner  # noqa: E402
from plenopticam.lfp_extractor.lfp_cropper import LfpCropper  # noqa: E402
from plenopticam.lfp_extractor.lfp_rearranger import LfpRearranger  # noqa: E402

LEAST = 40.0  # dB

folder = sys.argv[1]
geometry = json.load(open(f"{folder}/geometry.json"))
raw = np.load(f"{folder}/picture.npy").astype(float)
reference = np.load(f"{folder}/reference.npy").astype(float)

config = PlenopticamConfig()
config.default_values()
settings = config.params
place = tempfile.mkdtemp()
settings.update({config.lfp_path: f"{place}/raw.png", config.cal_path: place, config.smp_meth: "local"})
settings.update({config.ptc_leng: geometry["views"], config.opt_prnt: False, config.opt_dbug: False})
for option in ["vign", "cont", "colo", "awb_", "sat_", "refo", "refi", "lier", "dpth", "rota", "arti"]:
    settings[getattr(config, f"opt_{option}")] = False
centres = np.array(geometry["centres_px"])
rows, columns = np.mgrid[0 : centres.shape[0], 0 : centres.shape[1]]
config.calibs[config.mic_list] = (
    np.stack([centres[..., 1], centres[..., 0], rows, columns], -1).reshape(-1, 4).tolist()
)
config.calibs[config.pat_type] = "rec"
config.calibs[config.ptc_mean] = [geometry["pitch_px"]] * 2

aligner = LfpAligner(raw, cfg=config)
aligner.main()
cropper = LfpCropper(lfp_img_align=aligner.lfp_img, cfg=config)
cropper.main()
rearranger = LfpRearranger(cropper.lfp_img_align, cfg=config)
rearranger.main()
views = rearranger.vp_img_arr.astype(float)
assert views.shape == reference.shape, (views.shape, reference.shape)

# It scales what it writes to 16 bits: back by least squares.
pairs = np.stack([views.ravel(), np.ones(views.size)], 1)
scale, shift = np.linalg.lstsq(pairs, reference.ravel(), rcond=None)[0]
errors = ((views * scale + shift - reference) ** 2).mean((2, 3, 4))
psnr = -10 * np.log10(errors)
print(f"plenopticam 0.9.3: worst view {psnr.min():.1f} dB, median {np.median(psnr):.1f} dB")
sys.exit(0 if psnr.min() >= LEAST else 1)
