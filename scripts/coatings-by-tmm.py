#!/usr/bin/env python3
"""Transmittance and reflectance of coatings by PyPI's tmm (S. Byrnes), for crates/optics/tests/data/coatings.json.

    pip install tmm==0.2.0 && scripts/coatings-by-tmm.py > crates/optics/tests/data/coatings.json
"""

import json
import math

from tmm import coh_tmm

# Index and extinction before, of each layer with its thickness (nm), and behind.
STACKS = [
    ([1.0, 0.0], [], [1.5168, 0.0]),
    ([1.0, 0.0], [[1.38, 0.0, 99.64]], [1.5168, 0.0]),
    ([1.0, 0.0], [[1.38, 0.0, 99.64], [2.1, 0.0, 130.9], [1.62, 0.0, 84.9]], [1.5168, 0.0]),
    ([1.5168, 0.0], [[2.35, 0.0, 58.5], [1.46, 0.0, 94.2], [2.35, 0.0, 58.5], [1.46, 0.0, 94.2]], [1.0, 0.0]),
    ([1.0, 0.0], [[1.46, 0.0, 94.0]], [0.958, 6.69]),
    ([1.0, 0.0], [[2.35, 0.0, 58.5], [1.46, 0.0, 94.2], [2.35, 0.0, 58.5], [1.46, 0.0, 94.2]], [0.05, 3.6]),
    ([1.0, 0.0], [[1.7, 0.02, 350.0], [2.0, 0.1, 40.0]], [1.5168, 0.0]),
]


def main():
    rows = []
    for before, layers, behind in STACKS:
        for wavelength in [430.0, 550.0, 700.0]:
            for angle in [0.0, 15.0, 40.0, 75.0]:
                n = [complex(*before), *[complex(a, b) for a, b, _ in layers], complex(*behind)]
                d = [math.inf, *[d for _, _, d in layers], math.inf]
                theta = math.radians(angle)
                if behind[1] == 0.0 and abs(before[0] * math.sin(theta) / behind[0]) >= 1.0:
                    continue
                both = [coh_tmm(kind, n, d, theta, wavelength) for kind in "sp"]
                rows.append({
                    "before": before[0], "layers": layers, "behind": behind,
                    "wavelength": wavelength, "angle": angle,
                    "reflectance": sum(float(one["R"]) for one in both) / 2.0,
                    "transmittance": sum(float(one["T"]) for one in both) / 2.0,
                })
    print("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]")


if __name__ == "__main__":
    main()
