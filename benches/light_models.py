"""What rough surfaces return of even light by the formulas of etendue and of Mitsuba: by how much their pictures are
known to differ.

* etendue: GGX facets with Heitz's masking of both directions together, and what they send to one another comes out in
  the end (Kulla and Conty 2017); its glTF surface is matte beneath, lit by what the facets leave on both ways.
* Mitsuba: GGX facets with the masking of each direction by itself, and what does not leave at once is lost; its
  `principled` has the diffuse reflection of Burley, "Physically-Based Shading at Disney", 2012, beneath.
"""

import math


def facets(mu, alpha):
    """Of facets seen at the cosine `mu`: the cosines on them, their weights, and the share of light that each returns,
    masked together and apart."""
    import numpy as np

    steep, azimuth = np.meshgrid((np.arange(128) + 0.5) / 128, 2 * math.pi * (np.arange(64) + 0.5) / 64)
    # By visible area (Dupuy and Benyoub 2023), more of them where few are: steep ones.
    seen = np.array([math.sqrt(1 - mu * mu), 0.0, mu])
    stretched = seen * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    z = steep**4 * (1 + stretched[2]) - stretched[2]
    r = np.sqrt(np.clip(1 - z * z, 0, None))
    normal = np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], -1) + stretched
    normal *= [alpha, alpha, 1.0]
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    cosine = normal @ seen
    out = np.maximum(2 * cosine * normal[..., 2] - mu, 0)
    lam = lambda z: (np.sqrt(1 + alpha**2 * (1 / np.maximum(z, 1e-9) ** 2 - 1)) - 1) / 2
    together = (1 + lam(mu)) / (1 + lam(mu) + lam(out)) * (out > 0)
    apart = 1 / (1 + lam(out)) * (out > 0)
    return cosine, steep**3 / (steep**3).sum(), together, apart


def over_directions(returned):
    """The mean of what is returned, by the cosine, of light from all sides."""
    cosines = [(k + 0.5) / 32 for k in range(32)]
    return sum(2 * mu * returned(mu) for mu in cosines) / len(cosines)


def schlick(cosine, face_on):
    return face_on + (1 - face_on) * (1 - cosine) ** 5


def fresnel(cosine, ior):
    """Reflectance of glass from outside."""
    import numpy as np

    within = np.sqrt(1 - (1 - cosine**2) / ior**2)
    parallel, across = ((a * cosine - b * within) / (a * cosine + b * within) for a, b in ((ior, 1), (1, ior)))
    return (parallel**2 + across**2) / 2


def white_metal(mu, roughness):
    """The share of light that Mitsuba's white metal returns at the cosine `mu`; etendue's returns all."""
    _, weights, _, apart = facets(mu, roughness**2)
    return float((weights * apart).sum())


def sheet(roughness, reflectance, is_together):
    """The mean of what facets of a reflectance by the cosine return."""
    def returned(mu):
        cosine, weights, together, apart = facets(mu, roughness**2)
        return float((weights * reflectance(cosine) * (together if is_together else apart)).sum())
    return over_directions(returned)


def metal(color, roughness):
    """The mean of what metal of a colour in one band returns by etendue."""
    at_once = sheet(roughness, lambda cosine: schlick(cosine, color), True)
    white, mean = sheet(roughness, lambda cosine: 1.0, True), color + (1 - color) / 21
    return at_once + mean**2 * white / (1 - mean * (1 - white)) * (1 - white)


def metal_of_mitsuba(color, roughness):
    """The same by Mitsuba's `roughconductor`, whose colour is the same from all sides."""
    return color * sheet(roughness, lambda cosine: 1.0, False)


def gltf(color, metallic, roughness):
    """The mean of what a glTF surface of ior 1.5 returns by etendue."""
    gloss = sheet(roughness, lambda cosine: schlick(cosine, 0.04), True)
    return metallic * metal(color, roughness) + (1 - metallic) * (gloss + color * (1 - gloss))


def gltf_of_mitsuba(color, metallic, roughness):
    """The same by Mitsuba's `principled`."""
    def reflectance(cosine):
        return metallic * schlick(cosine, color) + (1 - metallic) * fresnel(cosine, 1.5)
    return sheet(roughness, reflectance, False) + (1 - metallic) * color * burley(roughness)


def burley(roughness):
    """The mean of what Burley's diffuse reflection of a white surface returns."""
    import numpy as np

    middles = (np.arange(48) + 0.5) / 48
    out, into, azimuth = np.meshgrid(middles, middles, 2 * math.pi * middles)
    between = out * into + np.sqrt((1 - out**2) * (1 - into**2)) * np.cos(azimuth)
    # Twice the squared cosine between a direction and the one halfway.
    back = roughness * (1 + between)
    a, b = (1 - out) ** 5, (1 - into) ** 5
    value = (1 - a / 2) * (1 - b / 2) + back * (a + b + a * b * (back - 1))
    return float((4 * out * into * value).mean())
