"""The scenes that `light_agreement.py` compares pictures of: the jobs of `light_scenes.py`, and small ones for single
lights and surfaces."""

from dataclasses import dataclass
from typing import Callable

import light_models
import light_scenes
from light_meshes import closed_room, quad, sphere, textured_quad
from light_scenes import OUTDOORS, Scenes


@dataclass(frozen=True)
class Case:
    """A scene, and what is known of the pictures before they are rendered."""

    make: Callable[[Scenes], dict]
    # Surfaces that a path passes unscattered, which Mitsuba counts.
    passes: int = 0
    # By which share etendue's picture is known to be brighter.
    expected: float = 0.0
    # Where the models differ: what is known of it. Without an expected share the pictures are not compared.
    differs: str = ""


LAMP = {"lamp": {"type": "emissive", "radiance": [9.0, 8.0, 7.0]}}
EVEN = {"type": "environment", "radiance": [0.4, 0.5, 0.7]}
WHITE_EVEN = {"type": "environment", "radiance": [1.0, 1.0, 1.0]}


class Small(Scenes):
    """Small scenes."""

    def above(self, half=0.6):
        """A square lamp over the middle."""
        return self.part(quad([-half, 2.2, -half], [2 * half, 0, 0], [0, 0, 2 * half]), "lamp")

    def table(self, objects=(), lights=(), bounces=1):
        """Two boxes on a floor, under lights or objects that shine."""
        boxes = [{"shape": "box", "size": [0.6, 0.8, 0.6], "material": "red",
                  "transform": {"translate": [-0.7, 0.4, 0], "rotate": [0, 1, 0, 25]}},
                 {"shape": "box", "size": [0.5, 0.4, 0.7], "material": "green",
                  "transform": {"translate": [0.7, 0.2, 0.3], "rotate": [0, 1, 0, -30]}}]
        return self.scene(OUTDOORS, bounces, [self.floor(), *boxes, *objects], self.matte() | LAMP, list(lights))

    def shining(self, shape, transform, **more):
        """The table under a shape that shines."""
        return self.table([{"shape": shape, "material": "lamp", "transform": transform, **more}])

    def both_sides(self):
        """A room with a sheet in the middle that shines up and down."""
        sheet = {"shape": "rectangle", "width": 0.6, "height": 0.6, "material": "sheet",
                 "transform": {"translate": [0, 1.4, 0.2], "rotate": [1, 0, 0, 90]}}
        shines = {"sheet": {"type": "emissive", "radiance": [6.0, 5.0, 4.0], "two_sided": True}}
        return self.scene(light_scenes.INDOORS, 2, [*self.walls(), sheet], self.matte() | shines, [])

    def closed(self, bounces):
        return self.indoors(bounces, [*self.walls(closed_room), self.part(sphere([0, 0.4, 0], 0.4, 160), "white")])

    def behind(self):
        """A sheet whose back is seen, lit from there, before one whose front is."""
        sheets = [self.part(quad([-0.9, 0, -0.4], [0, 1.2, 0], [0.8, 0, 0]), "red"),
                  self.part(quad([0.1, 0, -0.4], [0.8, 0, 0], [0, 1.2, 0]), "red")]
        lamp = self.part(quad([-0.6, 2.2, 1.4], [1.2, 0, 0], [0, 0, 1.2]), "lamp")
        return self.scene(OUTDOORS, 2, [self.floor(), *sheets, lamp], self.matte() | LAMP, [])

    def ball(self, surface, bounces=4):
        """A ball of a surface beside a red box, under a lamp and even light."""
        ball = self.part(sphere([0.3, 0.6, 0], 0.6, 160), "surface")
        box = {"shape": "box", "size": [0.5, 0.9, 0.5], "material": "red",
               "transform": {"translate": [-0.9, 0.45, 0.2], "rotate": [0, 1, 0, 25]}}
        return self.scene(OUTDOORS, bounces, [self.floor(), ball, box, self.above()],
                          self.matte() | LAMP | {"surface": surface}, [EVEN])

    def plate(self, roughness):
        """White metal that fills the picture, seen at 60 degrees, in even light."""
        plate = self.part(quad([-9, 0, -9], [0, 0, 18], [18, 0, 0]), "metal")
        camera = {"from": [0, 4.0, 4.0 * 3**0.5], "look_at": [0, 0, 0], "fov": 2.0}
        metal = {"metal": {"type": "metal", "color": [1.0, 1.0, 1.0], "roughness": roughness}}
        return self.scene(camera, 2, [plate], metal, [WHITE_EVEN])

    def textured(self):
        image = {"type": "matte", "color": self.image()}
        floor = self.part(textured_quad([-2, 0, -2], [0, 0, 4], [4, 0, 0]), "image")
        ball = self.part(sphere([0, 0.6, 0], 0.6, 160), "image")
        return self.scene(OUTDOORS, 3, [floor, ball, self.above()], LAMP | {"image": image}, [EVEN])

    def half_there(self):
        """A floor that a lamp lights through a sheet which lets half of the light pass, seen from below the sheet.

        The sheet itself is out of sight: passing it counts as a surface in Mitsuba, which has to trace one more then.
        """
        sheet = self.part(quad([-0.8, 1.3, -0.8], [0, 0, 1.6], [1.6, 0, 0]), "sheet")
        half = {"sheet": {"type": "gltf", "color": [0.5, 0.5, 0.5], "opacity": 0.5}}
        camera = {"from": [0, 0.9, 3.6], "look_at": [0, 0.1, 0], "fov": 30.0}
        return self.scene(camera, 1, [self.floor(), sheet, self.above(1.0)], self.matte() | LAMP | half, [])

    def copies(self):
        """A ball in nine places, turned and scaled."""
        places = [{"translate": [0.6 * (k % 3 - 1), 0.3, 0.6 * (k // 3 - 1)], "rotate": [0.6, 0.8, 0, 40 * k],
                   "scale": 0.6 + 0.05 * k} for k in range(9)]
        egg = sphere([0, 0, 0], 0.3, 96)[0] * [1.0, 0.7, 0.5]
        copied = self.part((egg, sphere([0, 0, 0], 0.3, 96)[1]), "red") | {"instances": places}
        return self.scene(OUTDOORS, 3, [self.floor(), copied, self.above()], self.matte() | LAMP, [EVEN])


def metals(material):
    """By how much more than Mitsuba's a metal of etendue returns of even light, in the band where that is most."""
    return max(light_models.metal(color, material["roughness"])
               / light_models.metal_of_mitsuba(color, material["roughness"]) - 1 for color in material["color"])


def known_of_balls():
    balls = [{"color": [0.9, 0.6 + 0.06 * k, 0.3 + 0.12 * k], "roughness": 0.15 + 0.12 * k} for k in range(5)]
    most = [100 * metals(ball) for ball in balls]
    return (f"in even light the balls return {min(most):.0f} to {max(most):.0f} % more of one colour or another, as "
            "light that meets several facets comes out in the end, and as they turn white at grazing incidence; white "
            "metal is compared where it is so smooth that both return all light")


def known_of_asset():
    more = [100 * (light_models.gltf(color, 0.2, 0.4) / light_models.gltf_of_mitsuba(color, 0.2, 0.4) - 1)
            for color in (0.1, 0.6)]
    return (f"in even light the surface returns {-more[1]:.0f} to {-more[0]:.0f} % less: what lies beneath its gloss "
            "gets what that leaves, in Mitsuba's `principled` all of the light; smooth metal of glTF is compared")


def plate(roughness):
    """White metal, which returns all light by etendue's model, and a known share of it by Mitsuba's."""
    share = light_models.white_metal(0.5, roughness)
    known = f"Mitsuba's returns {100 * share:.1f} % of the light by the formula of its facets, etendue's all"
    return Case(lambda s: s.plate(roughness), expected=1 / share - 1, differs=known)


def metal(color, roughness):
    return {"type": "metal", "color": color, "roughness": roughness}


# Jobs whose models differ.
DIFFER = {light_scenes.BALLS: known_of_balls, light_scenes.ASSET: known_of_asset}
WHITE = [1.0, 1.0, 1.0]


def jobs():
    """The jobs that trace light and can be done here; lenses are taken as pinholes."""
    absent = [light_scenes.FACING, *light_scenes.left_out()]
    return {job: Case(make, differs=DIFFER[job]() if job in DIFFER else "")
            for job, (make, *_) in light_scenes.JOBS.items() if job not in absent}


def lights():
    """Small scenes of single lights."""
    at, intensity = [0.5, 3, 1.5], [30, 25, 20]
    point = {"type": "point", "at": at, "intensity": intensity}
    spot = point | {"type": "spot", "look_at": [0, 0.2, 0], "cone": 20, "inner_cone": 20}
    parallel = {"type": "directional", "direction": [-0.5, -1, -0.7], "irradiance": [3, 2.5, 2]}
    down = {"translate": [0, 2.2, 0], "rotate": [1, 0, 0, 90]}
    return {
        "point light": Case(lambda s: s.table(lights=[point])),
        # Mitsuba's soft edges fall off in another way.
        "spot with a sharp edge": Case(lambda s: s.table(lights=[spot])),
        "parallel light": Case(lambda s: s.table(lights=[parallel])),
        "sphere that shines": Case(lambda s: s.shining("sphere", {"translate": [0.2, 1.7, 0.6]}, radius=0.25)),
        "disk that shines": Case(lambda s: s.shining("disk", down, radius=0.5)),
        "rectangle that shines": Case(lambda s: s.shining("rectangle", down, width=1.2, height=0.8)),
        "sheet that shines on both sides": Case(Small.both_sides),
        "even light": Case(lambda s: s.table(lights=[EVEN], bounces=3)),
        "image of a sky": Case(lambda s: s.table(lights=[s.sky()], bounces=3)),
    }


def surfaces():
    """Small scenes of single surfaces, and of few and many of them on a path."""
    gold = {"type": "gltf", "metallic": 1.0, "roughness": 0.1}
    glass = {"type": "dielectric", "ior": 1.5}
    return {
        "closed room, 1 surface": Case(lambda s: s.closed(1)),
        "closed room, 2 surfaces": Case(lambda s: s.closed(2)),
        "closed room, 8 surfaces": Case(lambda s: s.closed(8)),
        "sheets from in front and behind": Case(Small.behind),
        "textured matte surfaces": Case(Small.textured),
        "mirror": Case(lambda s: s.ball({"type": "mirror", "color": [0.9, 0.8, 0.7]})),
        "white metal, roughness 0.05": Case(lambda s: s.ball(metal(WHITE, 0.05))),
        "white metal, roughness 0.1": Case(lambda s: s.ball(metal(WHITE, 0.1))),
        "plate of white metal, roughness 0.3, even light": plate(0.3),
        "plate of white metal, roughness 0.6, even light": plate(0.6),
        "gold of glTF, roughness 0.1": Case(lambda s: s.ball(gold | {"color": [1.0, 0.78, 0.34]})),
        "textured metal of glTF, roughness 0.1": Case(lambda s: s.ball(gold | {"color": s.image()})),
        "clear glass": Case(lambda s: s.ball(glass, 8)),
        "frosted glass, roughness 0.1": Case(lambda s: s.ball(glass | {"roughness": 0.1}, 8)),
        # Under a lamp: rays to points end at such a sheet in Mitsuba.
        "shadow of a sheet that is half there": Case(Small.half_there, passes=1),
        "copies of a mesh": Case(Small.copies),
    }


def cases():
    """All scenes by name."""
    return jobs() | lights() | surfaces()
