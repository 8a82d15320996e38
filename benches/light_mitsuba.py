"""Scenes of etendue by Mitsuba's own parts: those keys that `light_scenes.py` and `agreement_scenes.py` use."""

import math
from pathlib import Path


class Translator:
    """Of one scene, whose files are in a folder, into a dictionary of Mitsuba's."""

    def __init__(self, mi, scene, folder):
        self.mi, self.scene, self.folder = mi, scene, Path(folder)

    def parts(self, sampler, passes=0):
        """The whole scene. Mitsuba counts surfaces that a path passes unscattered, of which there are `passes`."""
        parts = {"type": "scene", "integrator": self.integrator(passes), "sensor": self.sensor(sampler)}
        for k, thing in enumerate(self.scene["objects"]):
            parts |= self.placed(f"object{k}", thing)
        for k, light in enumerate(self.scene.get("lights", [])):
            parts[f"light{k}"] = self.light(light)
        return parts

    def integrator(self, passes):
        tracer = self.scene["tracer"]
        if tracer["type"] == "facing":
            return {"type": "aov", "aovs": "depth:depth,normal:geo_normal"}
        # A depth of 2 is one surface; roulette begins where etendue's does.
        return {"type": "path", "max_depth": tracer.get("max_bounces", 1) + 1 + passes, "rr_depth": 5}

    def sensor(self, sampler):
        camera = self.scene["camera"]
        pose, (width, height) = camera["pose"], camera["sensor"]["resolution"]
        sensor = {
            "type": "perspective", "fov": camera["fov"],
            "to_world": self.mi.ScalarTransform4f().look_at(pose["from"], pose["look_at"], [0, 1, 0]),
            "sampler": {"type": sampler, "sample_count": self.scene["render"]["samples"]},
            "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                     "rfilter": {"type": "box"}},
        }
        if camera["type"] == "thin_lens":
            radius = 1e-3 * camera["focal_length"] / camera["f_number"] / 2
            sensor |= {"type": "thinlens", "aperture_radius": radius, "focus_distance": camera["focus_distance"]}
        return sensor

    def placed(self, name, thing):
        """An object, or all of its copies, by name."""
        material = self.scene.get("materials", {}).get(thing.get("material"))
        shape = self.shape(thing) | self.surface(material)
        if "instances" in thing:
            copies = {f"{name}_{k}": {"type": "instance", "of": {"type": "ref", "id": name},
                                      "to_world": self.transform(transform)}
                      for k, transform in enumerate(thing["instances"])}
            return {name: {"type": "shapegroup", "shape": shape}} | copies
        if material and material.get("two_sided"):
            return {name: shape, f"{name}_back": shape | self.back(thing)}
        return {name: shape}

    def back(self, thing):
        """Where a rectangle is turned over, a tenth of a millimetre behind itself."""
        turn = self.mi.ScalarTransform4f().translate([0, 0, -1e-4]).rotate([1, 0, 0], 180)
        return {"to_world": self.transform(thing.get("transform", {})) @ turn @ self.size(thing)}

    def shape(self, thing):
        to_world = self.transform(thing.get("transform", {})) @ self.size(thing)
        if "file" not in thing:
            kind = {"box": "cube"}.get(thing["shape"], thing["shape"])
            return {"type": kind, "to_world": to_world}
        path = (self.folder / thing["file"]).with_suffix(".ply")
        # It would make up normals for models that have none.
        with path.open("rb") as file:
            flat = b"property float nx" not in file.read(1000)
        # Its images begin at the lower edge.
        return {"type": "ply", "filename": str(path), "face_normals": flat, "flip_tex_coords": True,
                "to_world": to_world}

    def size(self, thing):
        """The scale that brings Mitsuba's shape to an object's size."""
        sizes = {
            "rectangle": lambda: [thing.get("width", 1.0) / 2, thing.get("height", 1.0) / 2, 1.0],
            "box": lambda: [side / 2 for side in thing.get("size", [1.0] * 3)],
            "sphere": lambda: [thing.get("radius", 1.0)] * 3,
            "disk": lambda: [thing.get("radius", 1.0)] * 2 + [1.0],
        }
        return self.mi.ScalarTransform4f().scale(sizes.get(thing.get("shape"), lambda: [1.0] * 3)())

    def transform(self, spec):
        if "matrix" in spec:
            return self.mi.ScalarTransform4f(spec["matrix"])
        *axis, angle = spec.get("rotate", [0, 1, 0, 0])
        scale = spec.get("scale", 1.0)
        made = self.mi.ScalarTransform4f().translate(spec.get("translate", [0, 0, 0])).rotate(axis, angle)
        return made.scale(scale if isinstance(scale, list) else [scale] * 3)

    def surface(self, material):
        """What a shape is made of."""
        if material is None:
            return {}
        if material["type"] == "emissive":
            return {"emitter": {"type": "area", "radiance": rgb(material["radiance"])},
                    "bsdf": {"type": "diffuse", "reflectance": rgb([0.0] * 3)}}
        own = getattr(self, material["type"])(material)
        opacity = material.get("opacity", 1.0)
        return {"bsdf": own if opacity == 1.0 else {"type": "mask", "opacity": opacity, "bsdf": own}}

    def dielectric(self, material):
        made = {"type": "dielectric", "int_ior": material["ior"], "ext_ior": 1.0}
        roughness = material.get("roughness", 0.0)
        return made | ({"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2} if roughness else {})

    def matte(self, material):
        return two_sided({"type": "diffuse", "reflectance": self.color(material)})

    def mirror(self, material):
        return two_sided({"type": "conductor", "material": "none", "specular_reflectance": self.color(material)})

    def metal(self, material):
        return two_sided({"type": "roughconductor", "material": "none", "distribution": "ggx",
                          "alpha": material["roughness"] ** 2, "specular_reflectance": self.color(material)})

    def gltf(self, material):
        return two_sided({"type": "principled", "base_color": self.color(material), "specular": 0.5,
                          "metallic": material.get("metallic", 0.0), "roughness": material.get("roughness", 0.5)})

    def color(self, material):
        color = material.get("color", [1.0, 1.0, 1.0])
        if isinstance(color, dict):
            return {"type": "bitmap", "filename": str(self.folder / color["image"])}
        return rgb(color)

    def light(self, light):
        return getattr(self, f"{light['type']}_light")(light)

    def point_light(self, light):
        return {"type": "point", "position": light["at"], "intensity": rgb(light["intensity"])}

    def spot_light(self, light):
        along = [b - a for a, b in zip(light["at"], light["look_at"])]
        up = [0, 0, 1] if abs(along[1]) > 0.9 * math.hypot(*along) else [0, 1, 0]
        return {"type": "spot", "to_world": self.mi.ScalarTransform4f().look_at(light["at"], light["look_at"], up),
                "intensity": rgb(light["intensity"]), "cutoff_angle": light["cone"],
                "beam_width": light["inner_cone"]}

    def directional_light(self, light):
        return {"type": "directional", "direction": light["direction"], "irradiance": rgb(light["irradiance"])}

    def environment_light(self, light):
        if "image" not in light:
            return {"type": "constant", "radiance": rgb(light["radiance"])}
        import numpy as np

        texels = np.array(self.mi.Bitmap(str(self.folder / light["image"])), np.float32)[..., :3]
        # Its images begin at another side.
        return {"type": "envmap", "bitmap": self.mi.Bitmap(pole_to_pole(texels)),
                "to_world": self.mi.ScalarTransform4f().rotate([0, 1, 0], 180)}


def rgb(color):
    return {"type": "rgb", "value": list(color)}


def two_sided(inner):
    return {"type": "twosided", "inner": inner}


def pole_to_pole(texels):
    """The same light by 2 n + 1 rows. Mitsuba's first and last row are at the poles, those of etendue's n rows half a
    row off them; halfway between two rows light is their mean."""
    import numpy as np

    edged = np.concatenate([texels[:1], texels, texels[-1:]])
    rows = np.empty((2 * len(texels) + 1, *texels.shape[1:]), texels.dtype)
    rows[0::2] = (edged[1:] + edged[:-1]) / 2
    rows[1::2] = texels
    return rows
