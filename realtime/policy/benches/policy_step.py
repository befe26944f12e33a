"""The policy of policy_step.rs on ONNX Runtime, one thread: reads its weights, answers microseconds a step."""

import sys
import time

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

INPUTS, OUTPUTS, HIDDEN, ADAPTER, CALLS = 48, 6, 256, 64, 2000

numbers = np.fromfile(sys.argv[1], dtype="<f4")
at, weights, nodes = 0, [], []


def take(name, *shape):
    global at
    count = int(np.prod(shape))
    weights.append(numpy_helper.from_array(numbers[at : at + count].reshape(shape), name))
    at += count
    return name


def node(kind, *inputs):
    out = f"n{len(nodes)}"
    nodes.append(helper.make_node(kind, list(inputs), [out]))
    return out


def dense(x, name, inputs, outputs):
    return node("Gemm", x, take(f"{name}.w", inputs, outputs), take(f"{name}.b", outputs))


def lateral(h, name, width):
    alpha = take(f"{name}.alpha", 1)
    v, m = take(f"{name}.v", HIDDEN, ADAPTER), take(f"{name}.m", ADAPTER, width)
    return node("MatMul", node("Relu", node("MatMul", node("Mul", h, alpha), v)), m)


mean, scale, step = take("mean", INPUTS), take("scale", INPUTS), take("step", OUTPUTS)
x = node("Mul", node("Sub", "observation", mean), scale)
first = node("Relu", dense(x, "a1", INPUTS, HIDDEN))
second = node("Relu", dense(first, "a2", HIDDEN, HIDDEN))
take("a3.w", HIDDEN, OUTPUTS), take("a3.b", OUTPUTS)
own = node("Relu", dense(x, "b1", INPUTS, HIDDEN))
own = dense(own, "b2", HIDDEN, HIDDEN)
own = node("Relu", node("Add", own, lateral(first, "l2", HIDDEN)))
out = dense(own, "b3", HIDDEN, OUTPUTS)
out = node("Add", out, lateral(second, "l3", OUTPUTS))
action = node("Mul", node("Tanh", out), step)
assert at == len(numbers), (at, len(numbers))

value = helper.make_tensor_value_info
used = {name for n in nodes for name in n.input}
graph = helper.make_graph(
    nodes,
    "policy",
    [value("observation", TensorProto.FLOAT, [1, INPUTS])],
    [value(action, TensorProto.FLOAT, [1, OUTPUTS])],
    [weight for weight in weights if weight.name in used],
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
options = onnxruntime.SessionOptions()
options.intra_op_num_threads = options.inter_op_num_threads = 1
session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
observations = [{"observation": o} for o in np.random.default_rng(1).uniform(-1, 1, (64, 1, INPUTS)).astype("f4")]
run = session.run

print("ready", flush=True)
for _ in sys.stdin:
    best = float("inf")
    for _ in range(3):
        began = time.perf_counter()
        for call in range(CALLS):
            run(None, observations[call % 64])
        best = min(best, time.perf_counter() - began)
    print(best / CALLS * 1e6, flush=True)
