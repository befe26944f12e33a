"""Stands in for the CUDA libraries that PyTorch's wheel loads but a processor never calls.

The wheel's libraries name some 3 GB of others. Each that is missing is made here: empty but for the symbols, with
their versions, that the loader wants resolved. Run by the Python whose PyTorch it is; needs binutils and gcc.
"""

import re
import subprocess
import sysconfig
import tempfile
from collections import defaultdict
from pathlib import Path

packages = Path(sysconfig.get_paths()["purelib"])
lib = packages / "torch" / "lib"


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


for real in (packages / "nvidia").glob("*/lib/lib*.so.*"):
    here = lib / real.name
    here.unlink(missing_ok=True)
    here.symlink_to(real)

libraries = sorted(lib.glob("lib*.so"))
missing, wanted, versions = set(), defaultdict(set), {}
for library in libraries:
    missing |= set(re.findall(r"(\S+) => not found", output("ldd", library)))
    file = None
    for line in output("readelf", "-W", "-V", library).splitlines():
        if found := re.search(r"File: (\S+)", line):
            file = found[1]
        elif found := re.search(r"Name: (\S+) ", line):
            versions[found[1]] = file
    for name in output("nm", "-D", "--undefined-only", library).split("\n"):
        if found := re.search(r"[UwV] (\w+)(?:@(\S+))?$", name):
            wanted[found[2]].add(found[1])

# Symbols without a version could be anyone's: every stand-in without versions has those that look like these libraries'.
loose = {name for name in wanted[None] if re.match(r"nccl|cudnn|cublas|cufft|cusparse|cusolver|nvrtc|cuFile|nvml|cu[A-Z]", name)}
for name in sorted(missing):
    groups = {version: wanted[version] for version, file in versions.items() if file == name and wanted[version]}
    free = set() if groups else loose
    with tempfile.TemporaryDirectory() as folder:
        source, script = Path(folder) / "stub.c", Path(folder) / "stub.map"
        symbols = set().union(free, *groups.values())
        source.write_text("".join(f"char {symbol}[64];\n" for symbol in sorted(symbols)))
        blocks = [f"{version} {{ global: {'; '.join(sorted(names))}; }};" for version, names in groups.items()]
        flags = []
        if blocks:
            script.write_text("\n".join(blocks) + "\n")
            flags = [f"-Wl,--version-script={script}"]
        command = ["gcc", "-shared", "-w", "-x", "c", source, f"-Wl,-soname,{name}", *flags, "-o", lib / name]
        subprocess.run(command, check=True)
