"""The encoder of encoder.rs on PyTorch or ONNX Runtime, one thread: reads its weights and samples, checks that the
logits are ours to 1e-4, answers milliseconds a cloud."""

import sys
import time

import numpy as np
from safetensors.numpy import load_file

POINTS, CHANNELS, CENTRES, NEIGHBOURS, HOMES, CLASSES, LAYERS = 512, 10, 64, 16, 3, 8, 4
ZOOM, SHAPE_ZOOM, EPSILON = 5.0, 4.0, 1e-5
kind, weights, samples = sys.argv[1:]
w = load_file(weights)


def folded(name, matrix=None):
    """A linear layer with its normalisation folded in."""
    scale = w[f"{name}.gain"] / np.sqrt(w[f"{name}.variance"] + EPSILON)
    matrix = w[f"{name}.weight"] if matrix is None else matrix
    return matrix * scale, w[f"{name}.bias"] - w[f"{name}.mean"] * scale


def member(p, c):
    """What the network reads of points seen from their centres."""
    shape = np.concatenate([p[:, 6:9], 1.0 - p[:, 9:]], axis=1) * SHAPE_ZOOM
    return np.concatenate([(p[:, :3] - c[:, :3]) * ZOOM, p[:, :6], shape], axis=1)


def read(file):
    raw = np.fromfile(file, dtype="<u4")
    count, at, out = int(raw[0]), 1, []

    def take(shape, kind):
        nonlocal at
        size = int(np.prod(shape))
        block = raw[at : at + size].view(kind).reshape(shape)
        at += size
        return block

    for _ in range(count):
        points = take((POINTS, CHANNELS), "<f4")
        centres, groups = take((CENTRES,), "<u4"), take((CENTRES, NEIGHBOURS), "<u4")
        home, share, logits = take((POINTS, HOMES), "<u4"), take((POINTS, HOMES), "<f4"), take((CLASSES,), "<f4")
        members = member(points[groups.ravel()], np.repeat(points[centres], NEIGHBOURS, axis=0))
        inputs = {
            "members": members.astype("f4"),
            "places": points[centres][:, :3].copy(),
            "points": member(points, points[centres[home[:, 0]]]).astype("f4"),
            "home": home.astype("i8"),
            "share": share[:, :, None].copy(),
        }
        out.append((inputs, logits))
    assert at == len(raw), (at, len(raw))
    return out


embed = [folded("encoder.embed.0"), folded("encoder.embed.1")]
half = 16.0**-0.25
attention = [
    {
        "place": w[f"encoder.attention.{i}.place"],
        "key": w[f"encoder.attention.{i}.key"] * np.float32(half),
        "value": w[f"encoder.attention.{i}.value"],
        "offset": folded(f"encoder.attention.{i}.offset"),
    }
    for i in range(LAYERS)
]
fuse, class_hidden, segment_hidden = folded("encoder.fuse"), folded("class.hidden"), folded("segment.hidden")
segment_token, _ = folded("segment.point", w["segment.token"])
segment_cloud, _ = folded("segment.point", w["segment.cloud"])
segment_point = folded("segment.point")


def pytorch():
    import torch
    import torch.nn.functional as F

    torch.set_num_threads(1)
    t = lambda a: torch.from_numpy(np.ascontiguousarray(a, dtype="f4"))
    dense = lambda pair: (t(pair[0].T), t(pair[1]))

    class Encoder(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.embed = [dense(e) for e in embed]
            self.attention = [(t(a["place"].T), t(a["key"].T), t(a["value"].T), *dense(a["offset"])) for a in attention]
            self.fuse, self.class_hidden = dense(fuse), dense(class_hidden)
            self.out = (t(w["class.out.weight"].T), t(w["class.out.bias"]))
            self.token, self.cloud = t(segment_token.T), t(segment_cloud.T)
            self.point, self.segment_hidden = dense(segment_point), dense(segment_hidden)
            self.segment_out = (t(w["segment.out.weight"].T), t(w["segment.out.bias"]))

        def forward(self, members, places, points, home, share):
            x = F.relu(F.linear(members, *self.embed[0]))
            x = F.relu(F.linear(x, *self.embed[1])).view(CENTRES, NEIGHBOURS, -1).amax(1)
            layers = [x]
            for place, key, value, offset, bias in self.attention:
                x = x + F.linear(places, place)
                k = F.linear(x, key)
                a = torch.softmax(k @ k.T, -1)
                a = a / (a.sum(0, keepdim=True) + 1e-9)
                seen = a.T @ F.linear(x, value)
                x = x + F.relu(F.linear(x - seen, offset, bias))
                layers.append(x)
            fused = F.relu(F.linear(torch.cat(layers, 1), *self.fuse))
            cloud = torch.cat([fused.amax(0), fused.mean(0)]).unsqueeze(0)
            logits = F.linear(F.relu(F.linear(cloud, *self.class_hidden)), *self.out)
            context = F.linear(fused, self.token) + F.linear(cloud, self.cloud)
            own = F.linear(points, *self.point) + (context[home] * share).sum(1)
            segment = F.linear(F.relu(F.linear(F.relu(own), *self.segment_hidden)), *self.segment_out)
            return logits, segment

    inputs = [{k: torch.from_numpy(v) for k, v in inputs.items()} for inputs, _ in read(samples)]
    encoder = Encoder().eval()
    ways = {"eager": encoder}
    with torch.inference_mode():
        ways["traced"] = torch.jit.freeze(torch.jit.trace(encoder, tuple(inputs[0].values())))

        def run(forward, sample):
            with torch.inference_mode():
                return [v.numpy() for v in forward(*sample.values())]

        # The faster of the two stands for PyTorch.
        spent = {}
        for name, forward in ways.items():
            for sample in inputs * 4:
                run(forward, sample)
            began = time.perf_counter()
            for sample in inputs * 4:
                run(forward, sample)
            spent[name] = time.perf_counter() - began
    best = min(spent, key=spent.get)
    print(f"PyTorch {torch.__version__}, {best}", file=sys.stderr)
    return lambda sample: run(ways[best], sample), inputs


def onnxruntime():
    import onnx
    import onnxruntime as runtime
    from onnx import TensorProto, helper, numpy_helper

    nodes, constants = [], []

    def constant(value, kind="f4"):
        name = f"c{len(constants)}"
        constants.append(numpy_helper.from_array(np.ascontiguousarray(value, dtype=kind), name))
        return name

    def node(kind, *inputs, **attributes):
        out = f"n{len(nodes)}"
        nodes.append(helper.make_node(kind, list(inputs), [out], **attributes))
        return out

    linear = lambda x, pair: node("Gemm", x, constant(pair[0]), constant(pair[1]))
    product = lambda x, matrix: node("MatMul", x, constant(matrix))
    relu = lambda x: node("Relu", x)
    shape = lambda *sides: constant(sides, "i8")
    x = relu(linear(relu(linear("members", embed[0])), embed[1]))
    x = node("ReduceMax", node("Reshape", x, shape(CENTRES, NEIGHBOURS, -1)), shape(1), keepdims=0)
    layers = [x]
    for a in attention:
        x = node("Add", x, product("places", a["place"]))
        k = product(x, a["key"])
        soft = node("Softmax", node("MatMul", k, node("Transpose", k, perm=[1, 0])), axis=-1)
        soft = node("Div", soft, node("Add", node("ReduceSum", soft, shape(0), keepdims=1), constant([1e-9])))
        seen = node("MatMul", node("Transpose", soft, perm=[1, 0]), product(x, a["value"]))
        x = node("Add", x, relu(linear(node("Sub", x, seen), a["offset"])))
        layers.append(x)
    fused = relu(linear(node("Concat", *layers, axis=1), fuse))
    tops = [node(kind, fused, shape(0), keepdims=1) for kind in ("ReduceMax", "ReduceMean")]
    cloud = node("Concat", *tops, axis=1)
    logits = linear(relu(linear(cloud, class_hidden)), (w["class.out.weight"], w["class.out.bias"]))
    context = node("Add", product(fused, segment_token), product(cloud, segment_cloud))
    heard = node("ReduceSum", node("Mul", node("Gather", context, "home", axis=0), "share"), shape(1), keepdims=0)
    own = relu(node("Add", linear("points", segment_point), heard))
    segment = linear(relu(linear(own, segment_hidden)), (w["segment.out.weight"], w["segment.out.bias"]))

    value = helper.make_tensor_value_info
    real = TensorProto.FLOAT
    graph = helper.make_graph(
        nodes,
        "encoder",
        [
            value("members", real, [CENTRES * NEIGHBOURS, CHANNELS + 3]),
            value("places", real, [CENTRES, 3]),
            value("points", real, [POINTS, CHANNELS + 3]),
            value("home", TensorProto.INT64, [POINTS, HOMES]),
            value("share", real, [POINTS, HOMES, 1]),
        ],
        [value(logits, real, [1, CLASSES]), value(segment, real, [POINTS, 1])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model)
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = runtime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    print(f"ONNX Runtime {runtime.__version__}", file=sys.stderr)
    return lambda sample: session.run(None, sample), [inputs for inputs, _ in read(samples)]


run, inputs = {"pytorch": pytorch, "onnxruntime": onnxruntime}[kind]()
for sample, (_, ours) in zip(inputs, read(samples)):
    off = np.abs(run(sample)[0].ravel() - ours).max()
    assert off < 1e-4 * max(1.0, np.abs(ours).max()), f"logits {off} off"

print("ready", flush=True)
for _ in sys.stdin:
    best = float("inf")
    for _ in range(3):
        began = time.perf_counter()
        for sample in inputs:
            run(sample)
        best = min(best, time.perf_counter() - began)
    print(best / len(inputs) * 1e3, flush=True)
