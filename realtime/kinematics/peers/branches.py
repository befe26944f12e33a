"""Closed-form kinematics of Universal Robots arms by ur_analytic_ik.

For a line "MODEL q1 … q6" answers the pose there, row by row without the last, then all positions that
reach it; for "MODEL time" microseconds a call, the call from Python included.
"""

import sys
import time

import numpy
import ur_analytic_ik

print("ready", flush=True)
for line in sys.stdin:
    name, *words = line.split()
    model = getattr(ur_analytic_ik, name)
    if words == ["time"]:
        draws = numpy.random.default_rng(1).uniform(-numpy.pi, numpy.pi, (1000, 6))
        poses = [model.forward_kinematics(*draw) for draw in draws]
        began = time.perf_counter()
        for pose in poses:
            model.inverse_kinematics(pose)
        print((time.perf_counter() - began) / len(poses) * 1e6, flush=True)
        continue
    pose = model.forward_kinematics(*map(float, words))
    branches = model.inverse_kinematics(pose)
    numbers = numpy.concatenate([pose[:3].ravel(), *(numpy.ravel(branch) for branch in branches)])
    print(*(repr(float(number)) for number in numbers), flush=True)
