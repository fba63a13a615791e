"""Measure for ``--plugin``: VMAF of views, by libvmaf in FFmpeg of the package imageio-ffmpeg (model vmaf_v0.6.1).

raytrace-ii measure apples.png decoded.png --plugin examples/vmaf.py
VMAF was trained on video seen from three heights of a screen: for views it is one more opinion. The views are frames,
row by row, compared by luma of 8 bit; the feature of motion is off, since a step of views is no time.
"""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe

from metrics import Measure, Needs, register_measure

LUMA = np.array([0.2126, 0.7152, 0.0722])
LEAST = 32  # pixels of a side: four scales of its features


def vmaf(pair):
    """Return the mean VMAF of the sub-images, 0 to 100."""
    (width, height), scale = pair.reference.lenses, 255 / pair.peak
    with tempfile.TemporaryDirectory() as name:
        folder, inputs = Path(name), []
        for number, picture in enumerate((pair.decoded, pair.reference)):
            views = picture.light_field.astype(float) @ LUMA * scale
            path = folder / f"{number}.raw"
            path.write_bytes(np.rint(views).transpose(2, 3, 0, 1).astype(np.uint8).tobytes())
            inputs += ["-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{width}x{height}", "-i", str(path)]
        log = folder / "log.json"
        sized = "[0]format=yuv420p[a];[1]format=yuv420p[b];[a][b]"
        graph = f"{sized}libvmaf=log_fmt=json:log_path={log}:feature=name=motion\\\\:motion_force_zero=true"
        command = [get_ffmpeg_exe(), "-v", "error", "-nostdin", *inputs, "-lavfi", graph, "-f", "null", "-"]
        subprocess.run(command, check=True)
        return json.loads(log.read_text())["pooled_metrics"]["vmaf"]["mean"]


register_measure(
    Measure(name="q_vmaf", compute=vmaf, text="mean VMAF of sub-images", needs=Needs(regular=True, lenses=LEAST))
)
