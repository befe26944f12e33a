"""Parts modelled by somebody else: the outside set, as folders `tandem recognise` reads.

    python3 -m venv venv && venv/bin/pip install -r requirements.txt    # and Debian's openscad
    venv/bin/python parts.py look OUT/look
    venv/bin/python parts.py kept OUT/kept
    tandem recognise OUT/look

Shapes come from bd_warehouse (Apache-2.0), drawn by build123d (Apache-2.0), and from BOSL2 (BSD-2), as
solidpython2 ships it, drawn by OpenSCAD. No family of parts is in both halves: `look` may be looked at while
a model is made, `kept` is for the one measurement at the end.

What is true of a part was written down from the source of its generator, and of the kept half before any model
saw it: the class of the feature that is asked about, where its mouth or foot is, which way it looks. The width of the view is three
times the feature's extent, as the cell's camera frames it, never below 18 mm. A mesh that is there already is
not made again.
"""

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

UP, DOWN, BACK = (0, 0, 1), (0, 0, -1), (0, 1, 0)


@dataclass
class Part:
    """A part with one feature in question; lengths in mm."""

    half: str
    name: str
    family: str
    feature: str
    at: tuple
    axis: tuple
    extent: float
    # A build123d shape, or OpenSCAD source over BOSL2.
    make: Callable | str
    # What is up while it lies on the table, unless the axis.
    up: tuple | None = None
    # How far below the outermost point of the mesh a place without numbers is.
    sink: float = 0.0

    def width(self):
        return 3.0 * max(self.extent, 6.0)


PARTS: list[Part] = []


def part(*args, **more):
    PARTS.append(Part(*args, **more))


def on_axis(diameter, length):
    """Extent of a pin, screw or cone."""
    return max(diameter, 0.8 * length)


def of_slot(length, width):
    return max(0.45 * length, 2.0 * width)


# ---------------------------------------------------------------- bd_warehouse


def fastener(name, *args, **more):
    def make():
        import bd_warehouse.fastener as module

        return getattr(module, name)(*args, **more)

    return make


def from_module(module, name, *args, **more):
    def make():
        import importlib

        return getattr(importlib.import_module(f"bd_warehouse.{module}"), name)(*args, **more)

    return make


def plate(size, thickness, cut, thing, **options):
    """A plate, top at z = 0, with a hole of bd_warehouse's in the middle, cut for a thing."""

    def make():
        from bd_warehouse.bearing import PressFitHole
        from bd_warehouse.fastener import ClearanceHole, ThreadedHole
        from build123d import Align, Box, BuildPart, Locations

        holes = {hole.__name__: hole for hole in (ClearanceHole, ThreadedHole, PressFitHole)}
        # Made before the builder opens, which would add it to the plate.
        made_for = thing()
        with BuildPart() as made:
            Box(size, size, thickness, align=(Align.CENTER, Align.CENTER, Align.MAX))
            with Locations((0, 0, 0)):
                holes[cut](made_for, depth=thickness, **options)
        return made.part

    return make


def keyed_shaft(diameter, length, key, form):
    """A shaft along y with a keyway on top of it."""

    def make():
        from bd_warehouse.shaft_key import Keyway, ShaftKey
        from build123d import Cylinder, Rot

        cutter = Keyway(ShaftKey(diameter, key, form))
        return Rot(Z=90) * (Rot(Y=-90) * (Cylinder(diameter / 2, length) - cutter))

    return make


# Threaded holes.
for size, pitch, m in [("M6", "1", 5.2), ("M12", "1.75", 10.8), ("M20", "2.5", 18.0)]:
    part("look", f"hex-nut-{size.lower()}", "hex nut", "threaded_hole", (0, 0, m), UP, float(size[1:]),
         fastener("HexNut", f"{size}-{pitch}", "iso4032", simple=False))
for size, pitch, m in [("M8", "1.25", 6.5), ("M12", "1.75", 10.0)]:
    part("look", f"square-nut-{size.lower()}", "square nut", "threaded_hole", (0, 0, m), UP, float(size[1:]),
         fastener("SquareNut", f"{size}-{pitch}", "din557", simple=False))
for size, pitch, m in [("M6", "1", 6.0), ("M10", "1.5", 10.0)]:
    part("kept", f"flange-nut-{size.lower()}", "flange nut", "threaded_hole", (0, 0, m), UP, float(size[1:]),
         fastener("HexNutWithFlange", f"{size}-{pitch}", "din1665", simple=False))
part("kept", "plain-nut-m8", "unchamfered nut", "threaded_hole", (0, 0, 5.0), UP, 8.0,
     fastener("UnchamferedHexagonNut", "M8-1.25", "iso4036", simple=False))
for size, pitch, side, thickness in [("M8", "1.25", 40, 12), ("M12", "1.75", 60, 16)]:
    part("kept", f"tapped-plate-{size.lower()}", "tapped plate", "threaded_hole", (0, 0, 0), UP, float(size[1:]),
         plate(side, thickness, "ThreadedHole", fastener("SocketHeadCapScrew", f"{size}-{pitch}", 20),
               counter_sunk=False, simple=False))

# Smooth holes.
for size, hole, height in [("M8", 8.4, 1.6), ("M16", 17.0, 3.0)]:
    part("look", f"washer-{size.lower()}", "plain washer", "smooth_hole", (0, 0, height), UP, hole,
         fastener("PlainWasher", size, "iso7089"))
part("look", "ball-bearing-8-24-8", "ball bearing", "smooth_hole", (0, 0, 8), UP, 8.0,
     from_module("bearing", "SingleRowDeepGrooveBallBearing", "M8-24-8"))
for size, pitch, side, thickness, hole in [("M6", "1", 40, 10, 6.6), ("M10", "1.5", 60, 20, 11.0)]:
    part("look", f"clearance-plate-{size.lower()}", "clearance plate", "smooth_hole", (0, 0, 0), UP, hole,
         plate(side, thickness, "ClearanceHole", fastener("SocketHeadCapScrew", f"{size}-{pitch}", 20),
               counter_sunk=False))
part("look", "spacer-block", "spacer block", "smooth_hole", (0, 0, 12), UP, 7.2,
     from_module("open_builds", "SpacerBlock"))
for size, hole, height in [("M10", 10.5, 2.0), ("M18", 19.0, 3.0)]:
    part("kept", f"chamfered-washer-{size.lower()}", "chamfered washer", "smooth_hole", (0, 0, height), UP, hole,
         fastener("ChamferedWasher", size, "iso7090"))
part("kept", "eccentric-bushing", "bushing", "smooth_hole", (1, 0, 4), UP, 6.0,
     from_module("bushing", "HexFlangedEccentricBushing", 6, 10, 8, 4, 14, 1))
part("kept", "press-fit-plate", "press-fit plate", "smooth_hole", (0, 0, 0), UP, 24.0, 
     plate(50, 14, "PressFitHole", from_module("bearing", "SingleRowDeepGrooveBallBearing", "M8-24-8")))
part("kept", "sprocket-bore", "sprocket", "smooth_hole", (0, 0, None), UP, 12.0,
     from_module("sprocket", "Sprocket", 16, bore_diameter=12.0))

# Threaded axes, and the same screws with the smooth shank they are mostly drawn with.
for size, pitch, length in [("M8", "1.25", 20), ("M12", "1.75", 30)]:
    for simple, kind in [(False, "threaded"), (True, "smooth")]:
        part("look", f"hex-bolt-{size.lower()}-{kind}", "hex bolt", f"{kind}_axis", (0, 0, 0), DOWN,
             on_axis(float(size[1:]), length),
             fastener("HexHeadScrew", f"{size}-{pitch}", length, "iso4017", simple=simple))
for size, pitch, length in [("M6", "1", 16), ("M10", "1.5", 30)]:
    part("look", f"cap-screw-{size.lower()}", "cap screw", "threaded_axis", (0, 0, 0), DOWN,
         on_axis(float(size[1:]), length),
         fastener("SocketHeadCapScrew", f"{size}-{pitch}", length, "iso4762", simple=False))
part("look", "cap-screw-m8-lying", "cap screw", "threaded_axis", (0, 0, 0), DOWN, on_axis(8, 20),
     fastener("SocketHeadCapScrew", "M8-1.25", 20, "iso4762", simple=False), up=BACK)
part("look", "shoulder-screw-m10", "shoulder screw", "smooth_axis", (0, 0, 0), DOWN, on_axis(13, 25),
     fastener("ShoulderScrew", "M10-1.5", 25, simple=True))
part("look", "hex-bolt-m10-lying", "hex bolt", "smooth_axis", (0, 0, 0), DOWN, on_axis(10, 30),
     fastener("HexHeadScrew", "M10-1.5", 30, "iso4017", simple=True), up=BACK)
for simple, kind in [(False, "threaded"), (True, "smooth")]:
    part("kept", f"pan-screw-m6-{kind}", "pan screw", f"{kind}_axis", (0, 0, 0), DOWN, on_axis(6, 16),
         fastener("PanHeadScrew", "M6-1", 16, "iso1580", simple=simple))
    part("kept", f"button-screw-m10-{kind}", "button screw", f"{kind}_axis", (0, 0, 0), DOWN, on_axis(10, 25),
         fastener("ButtonHeadScrew", "M10-1.5", 25, "iso7380_1", simple=simple))
part("kept", "button-screw-m8-lying", "button screw", "threaded_axis", (0, 0, 0), DOWN, on_axis(8, 25),
     fastener("ButtonHeadScrew", "M8-1.25", 25, "iso7380_1", simple=False), up=BACK)
part("kept", "stepper-shaft", "stepper motor", "smooth_axis", (0, 0, None), UP, on_axis(5, 21),
     from_module("open_builds", "StepperMotor", "Nema17"), sink=21)

# Slots.
for shaft, key, form in [(20, 20, "A"), (30, 32, "A")]:
    part("look", f"keyway-{shaft}", "keyed shaft", "slot", (0, 0, shaft / 2), UP, of_slot(key, 0.28 * shaft),
         keyed_shaft(shaft, 2.5 * key, key, form))
part("look", "v-slot-rail", "extrusion", "slot", (0, 0, 10), UP, 18.0, lambda: lying_rail("VSlotLinearRail", "20x20", 60))
part("look", "v-slot-rail-40", "extrusion", "slot", (0, 0, 20), UP, 18.0, lambda: lying_rail("VSlotLinearRail", "40x40", 70, 10))
for size, pitch, head in [("M6", "1", 3.9), ("M10", "1.5", 6.0)]:
    diameter = {"M6": 10.0, "M10": 16.0}[size]
    part("look", f"slotted-head-{size.lower()}", "slotted cheese head", "slot", (0, 0, head), UP, of_slot(diameter, 2.0),
         fastener("CheeseHeadScrew", f"{size}-{pitch}", 16, "iso1207"))
part("kept", "gantry-plate-slot", "gantry plate", "slot", (-5, 0, 4.5), UP, of_slot(15.1, 5.1),
     from_module("open_builds", "CBeamGantryPlate"))
for size, pitch, diameter in [("M6", "1", 11.3), ("M10", "1.5", 18.3)]:
    part("kept", f"slotted-countersunk-{size.lower()}", "slotted countersunk head", "slot", (0, 0, 0), UP,
         of_slot(diameter, 2.0), fastener("CounterSunkScrew", f"{size}-{pitch}", 20, "iso2009"))


def lying_rail(name, size, length, off=0):
    """A rail along y, one of its grooves on top above the origin."""
    import bd_warehouse.open_builds as module
    from build123d import Pos, Rot

    return Pos(X=off) * (Rot(X=90) * (Pos(Z=-length / 2) * getattr(module, name)(size, length)))


# Cones.
for size, pitch, side, mouth in [("M6", "1", 40, 13.0), ("M10", "1.5", 50, 21.0)]:
    part("look", f"countersunk-plate-{size.lower()}", "countersunk plate", "cone", (0, 0, 0), UP, mouth,
         plate(side, 12, "ClearanceHole", fastener("CounterSunkScrew", f"{size}-{pitch}", 20, "iso10642")))
part("look", "countersunk-head-m12", "countersunk head", "cone", (0, 0, 0), DOWN, 24.0,
     fastener("CounterSunkScrew", "M12-1.75", 20, "iso10642"))
part("kept", "weld-neck-1", "weld neck", "cone", (0, 0, None), UP, 49.0, from_module("flange", "WeldNeckFlange", "1", 150), sink=39)
for size, pitch, side, mouth in [("M8", "1.25", 40, 17.3)]:
    part("kept", f"oval-countersunk-plate-{size.lower()}", "oval countersunk plate", "cone", (0, 0, 0), UP, mouth,
         plate(side, 12, "ClearanceHole", fastener("RaisedCounterSunkOvalHeadScrew", f"{size}-{pitch}", 20, "iso2010")))

# None of them.
part("look", "blind-flange-face", "blind flange", "other", (None, None, None), UP, 16.0, from_module("flange", "BlindFlange", "2", 150))
part("look", "o-ring", "o-ring", "other", (14.3, 0, 1.77), UP, 10.0, from_module("o_rings", "ORing", "214"))
part("kept", "domed-nut", "domed nut", "other", (None, None, None), UP, 14.0, fastener("DomedCapNut", "M10-1.5", "din1587"))
part("kept", "gear-rack", "rack", "other", (None, None, None), BACK, 16.0, from_module("gear", "RackGear", 3, 8, 20, 12))
part("kept", "sprocket-face", "sprocket", "other", (22, 0, None), UP, 16.0,
     from_module("sprocket", "Sprocket", 16, bore_diameter=12.0))

# ---------------------------------------------------------------- BOSL2


def scad(*libraries):
    includes = "".join(f"include <BOSL2/{name}.scad>\n" for name in ("std", *libraries))
    return lambda body: f"{includes}$fn=48; $slop=0;\n{body}\n"


threading, screws, joiners, sliders = scad("threading"), scad("screws"), scad("joiners"), scad("sliders")
trusses, caps, hinges, bearings = scad("cubetruss"), scad("bottlecaps"), scad("hinges"), scad("ball_bearings", "linear_bearings")
plain = scad()

part("look", "tapped-block-m10", "tapped block", "threaded_hole", (0, 0, 0), UP, 10.0,
     screws("diff() cuboid([32,32,14],anchor=TOP) attach(TOP) screw_hole(\"M10\",length=14.1,thread=true,anchor=TOP);"))
part("look", "threaded-nut-8", "threaded nut", "threaded_hole", (0, 0, 8), UP, 8.0,
     threading("threaded_nut(nutwidth=15,id=8,h=8,pitch=1.25,anchor=BOTTOM);"))
part("kept", "trapezoidal-nut-12", "trapezoidal nut", "threaded_hole", (0, 0, 12), UP, 12.0,
     threading("trapezoidal_threaded_nut(nutwidth=22,id=12,h=12,pitch=2.5,anchor=BOTTOM);"))
part("kept", "hex-nut-m16", "BOSL2 nut", "threaded_hole", (0, 0, 14), UP, 16.0,
     screws("nut(\"M16\",thickness=14,anchor=BOTTOM);"))
part("kept", "bottle-cap", "bottle cap", "threaded_hole", (None, None, None), UP, 28.0, caps("$fn=32; pco1881_cap(wall=2,anchor=BOTTOM);"))
part("look", "ball-bearing-608", "BOSL2 ball bearing", "smooth_hole", (0, 0, 7), UP, 8.0,
     bearings("ball_bearing(\"608\",anchor=BOTTOM);"))
part("kept", "linear-bearing-lm8", "linear bearing", "smooth_hole", (0, 0, 24), UP, 8.0,
     bearings("lmXuu_bearing(size=8,anchor=BOTTOM);"))
part("kept", "bored-block-m10", "bored block", "smooth_hole", (0, 0, 0), UP, 11.0,
     screws("diff() cuboid([36,28,12],anchor=TOP,rounding=2,edges=\"Z\") attach(TOP) screw_hole(\"M10\",length=12.1,thread=0,anchor=TOP);"))
for diameter, length, pitch in [(6, 14, 1), (16, 36, 2)]:
    part("look", f"threaded-rod-{diameter}", "threaded rod", "threaded_axis", (0, 0, 0), UP, on_axis(diameter, length),
         threading(f"threaded_rod(d={diameter},l={length},pitch={pitch},bevel2=true,anchor=BOTTOM);"
                   f"cuboid([{2 * diameter},{2.5 * diameter},{diameter / 2}],anchor=TOP);"))
part("kept", "acme-rod-12", "acme rod", "threaded_axis", (0, 0, 0), UP, on_axis(12, 30),
     threading("acme_threaded_rod(d=12,l=30,pitch=2.5,bevel2=true,anchor=BOTTOM);cyl(d=24,h=6,anchor=TOP);"))
part("kept", "bottle-neck", "bottle neck", "threaded_axis", (0, 0, 0), UP, 28.0, caps("$fn=32; pco1881_neck(wall=2);"))
part("look", "blank-screw-m6", "BOSL2 screw blank", "smooth_axis", (0, 0, 0), DOWN, on_axis(6, 18),
     screws("screw(\"M6\",length=18,head=\"hex\",thread=0,anchor=\"head_bot\");"))
part("look", "dowel-8", "dowel", "smooth_axis", (0, 0, 0), UP, on_axis(8, 16),
     plain("cuboid([30,24,6],chamfer=1,edges=TOP,anchor=TOP);cyl(d=8,h=16,chamfer2=1,anchor=BOTTOM);"))
part("kept", "shoulder-screw-bosl2", "BOSL2 shoulder screw", "smooth_axis", (0, 0, 0), DOWN, on_axis(8, 16),
     screws("shoulder_screw(\"iso\",8,length=16,head=\"socket\",anchor=\"shoulder_top\");"))
part("kept", "round-boss-12", "rounded boss", "smooth_axis", (0, 0, 0), UP, on_axis(12, 14),
     plain("tube(od=40,id=30,h=5,anchor=TOP);cyl(d=36,h=3,anchor=TOP);cyl(d=12,h=14,rounding2=1.5,anchor=BOTTOM);"))
for width, height in [(8, 5), (14, 8)]:
    part("look", f"dovetail-{width}", "dovetail", "slot", (0, 0, 0), UP, of_slot(40, width),
         joiners(f"diff() cuboid([40,36,{2 * height}],anchor=TOP) "
                 f"attach(TOP) tag(\"remove\") dovetail(\"female\",width={width},height={height},slide=36);"))
part("kept", "slider-channel", "slider", "slot", (None, None, None), UP, of_slot(30, 10), sliders("slider(l=30,base=10,wall=4);"))
part("kept", "round-slot-28", "blind slot", "slot", (0, 0, 0), UP, of_slot(28, 8),
     plain("difference(){cuboid([60,40,10],anchor=TOP); down(6) linear_extrude(7) rect([28,8],rounding=4);}"))
part("kept", "slotted-cap-m8", "BOSL2 slotted screw", "slot", (None, None, None), UP, of_slot(13, 2.4),
     screws("screw(\"M8\",length=16,head=\"cheese\",drive=\"slot\");"))
for wide, tip, length in [(16, 8, 20), (10, 2, 16)]:
    part("look", f"taper-pin-{wide}", "taper pin", "cone", (0, 0, 0), UP, on_axis(wide, length),
         plain(f"cuboid([{3 * wide},{2.4 * wide},6],anchor=TOP);cyl(d1={wide},d2={tip},h={length},anchor=BOTTOM);"))
part("look", "flat-hole-m8", "BOSL2 countersunk hole", "cone", (0, 0, 0), UP, 16.0,
     screws("diff() cuboid([36,36,12],anchor=TOP) attach(TOP) screw_hole(\"M8\",length=12.1,head=\"flat\",anchor=TOP);"))
part("kept", "taper-plug-24", "taper plug", "cone", (0, 0, 0), UP, on_axis(24, 18),
     plain("cyl(d=30,h=8,chamfer=1,anchor=TOP);cyl(d1=24,d2=18,h=18,anchor=BOTTOM);"))
part("kept", "onion", "onion", "cone", (0, 0, 4.7), UP, on_axis(18.4, 11),
     plain("down(3) intersection(){onion(r=12,ang=40,$fn=96);cuboid([40,40,40],anchor=BOTTOM);}"))
part("kept", "npt-rod", "tapered tube", "cone", (0, 0, 0), UP, on_axis(18, 22),
     plain("cuboid([44,40,5],anchor=TOP);tube(h=22,od1=18,od2=11,id=6,anchor=BOTTOM);"))
for length, width, depth in [(12, 10, 4), (15, 12, 5), (20, 16, 10)]:
    part("look", f"rabbit-clip-{length}", "rabbit clip", "buckle", (0, 0, 0), UP, max(length, width, depth),
         joiners(f"rabbit_clip(\"pin\",length={length},width={width},snap=0.8,thickness=1.6,depth={depth},anchor=BOTTOM,orient=UP);"
                 f"cuboid([{2 * width},{2 * depth + 8},4],anchor=TOP);"))
part("look", "rabbit-clip-lock", "rabbit clip", "buckle", (0, 0, 0), UP, 14,
     joiners("rabbit_clip(\"pin\",length=14,width=14,snap=1.2,thickness=1.8,depth=8,lock=true,anchor=BOTTOM,orient=UP);"
             "cuboid([30,20,4],anchor=TOP);"))
for size in ["standard", "medium", "small"]:
    length = {"standard": 10.8, "medium": 8.0, "small": 6.0}[size]
    part("kept", f"snap-pin-{size}", "snap pin", "buckle", (0, 0, 0), UP, length,
         joiners(f"cuboid([22,18,4],anchor=TOP); snap_pin(\"{size}\",anchor=BOTTOM,orient=UP);"))
part("kept", "snap-pin-large", "snap pin", "buckle", (0, 0, 0), UP, 20,
     joiners("cuboid([40,30,5],anchor=TOP); snap_pin(d=12,l=20,nub_depth=8,snap=1.2,thickness=2.4,anchor=BOTTOM,orient=UP);"))
part("kept", "truss-u-clip", "truss u-clip", "buckle", (None, None, None), BACK, 12.0, trusses("cubetruss_uclip(dual=false);"))
part("look", "spheroid", "spheroid", "other", (0, 0, 0), UP, 16.0,
     plain("cuboid([50,40,8],anchor=TOP); spheroid(d=18);"))
part("look", "rib", "wedge", "other", (0, 0, 0), UP, 20.0,
     plain("cuboid([50,40,5],anchor=TOP); wedge([6,20,14],anchor=BOTTOM);"))
part("look", "boss-block", "prismoid", "other", (0, 0, 0), UP, 18.0,
     plain("cuboid([60,50,6],anchor=TOP); prismoid([18,12],[14,9],h=8,anchor=BOTTOM);"))
part("look", "text", "raised text", "other", (0, 0, 0), UP, 20.0,
     plain("cuboid([60,30,4],anchor=TOP); text3d(\"A7\",h=2,size=12,anchor=BOTTOM);"))
part("kept", "truss-corner", "truss", "other", (None, None, None), UP, 24.0, trusses("cubetruss_corner(h=1,extents=1);"))
part("kept", "hirth", "hirth", "other", (14, 0, None), UP, 16.0, joiners("hirth(20,od=40,id=16,tooth_angle=60);"))
part("kept", "regular-prism", "hex prism", "other", (0, 0, 0), UP, 18.0,
     plain("cuboid([50,44,6],anchor=TOP); regular_prism(6,h=9,d=18,rounding=1,anchor=BOTTOM);"))
part("kept", "torus", "torus", "other", (14, 0, 3), UP, 12.0, plain("cuboid([60,60,4],anchor=TOP); torus(od=34,id=22,anchor=BOTTOM);"))


# ---------------------------------------------------------------- writing


def bosl2():
    """The folder that holds BOSL2 as solidpython2 ships it."""
    import importlib.util

    root = Path(importlib.util.find_spec("solid2").origin).parent
    return root / "extensions" / "bosl2"


def write(part, file):
    if isinstance(part.make, str):
        with tempfile.NamedTemporaryFile("w", suffix=".scad") as source:
            source.write(part.make)
            source.flush()
            command = ["openscad", "-o", str(file), "--export-format", "binstl", source.name]
            done = subprocess.run(command, env={"OPENSCADPATH": str(bosl2()), "PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
            if done.returncode != 0:
                raise RuntimeError("\n".join(line for line in done.stderr.splitlines() if "ERROR" in line) or done.stderr)
    else:
        from build123d import export_stl

        export_stl(part.make(), file, tolerance=0.02, angular_tolerance=0.15)


def place(part, file):
    """Where the feature is; what its place leaves open is that of the mesh's middle on the side it looks out of."""
    import numpy

    raw = numpy.fromfile(file, dtype=numpy.uint8)[84:]
    corners = raw.reshape(-1, 50)[:, 12:48].copy().view("<f4").reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = (low + high) / 2 + numpy.array(part.axis) * ((high - low) / 2 - part.sink)
    return [float(of_mesh) if v is None else v for v, of_mesh in zip(part.at, side)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("half", choices=["look", "kept"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", help="parts whose name contains this")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    lines = ["# Made by benches/outside/parts.py; see docs/outside.md.", 'unit = "mm"']
    failed = 0
    for part in PARTS:
        if part.half != args.half or (args.only and args.only not in part.name):
            continue
        file = args.folder / f"{part.name}.stl"
        try:
            if not file.exists():
                write(part, file)
            at = place(part, file)
        except Exception as error:
            failed += 1
            print(f"{part.name}: {error}", file=sys.stderr)
            continue
        print(part.name, file=sys.stderr)
        vector = lambda v: "[" + ", ".join(f"{x:g}" for x in map(float, v)) + "]"
        lines += ["", "[[part]]", f'file = "{part.name}.stl"', f'class = "{part.feature}"', f'family = "{part.family}"',
                  f"at_mm = {vector(at)}", f"axis = {vector(part.axis)}", f"width_mm = {part.width():g}"]
        if part.up:
            lines.append(f"up = {vector(part.up)}")
    (args.folder / "parts.toml").write_text("\n".join(lines) + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
