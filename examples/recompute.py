"""Recompute numbers of the benchmark with numpy and scipy alone, from pictures and results.

python examples/recompute.py picture REFERENCE.png DECODED.png COLUMNS ROWS
python examples/recompute.py rates ANCHOR.json RESULT.json MEASURE
Nothing of this package is imported. Pictures are II-pictures of 8 bit, COLUMNS×ROWS pixels under each lens. Formulas
are written anew from JPEG Pleno's common test conditions, BT.709-6, Wang et al. 2004 and Akima 1970.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import gaussian_filter


def main():
    """Print the numbers."""
    what, *words = sys.argv[1:] or [""]
    if what == "picture" and len(words) == 4:
        from PIL import Image

        a, b = (np.asarray(Image.open(path).convert("RGB")) for path in words[:2])
        for name, value in measures(a, b, int(words[2]), int(words[3])).items():
            print(f"{name} {value:.6f}")
    elif what == "rates" and len(words) == 3:
        for name, value in rates(*(json.loads(Path(path).read_text()) for path in words[:2]), words[2]).items():
            print(f"{name} {value:+.4f} %")
    else:
        raise SystemExit(__doc__)


def measures(a, b, columns, rows):
    """Return RGB PSNR, and mean and worst PSNR-YUV, its change along the serpentine, and SSIM of luma."""
    error = a.astype(float) - b
    psnr, ssim = np.empty((rows, columns)), np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            x, y = (codes(picture[row::rows, column::columns]) for picture in (a, b))
            mse = ((x - y) ** 2).mean(axis=(0, 1))
            psnr[row, column] = (
                np.dot([6, 1, 1], 20 * np.log10(1023) - 10 * np.log10(np.maximum(mse, 1e-12 * 1023**2))) / 8
            )
            ssim[row, column] = structural(x[..., 0], y[..., 0])
    path = np.concatenate([line if number % 2 == 0 else line[::-1] for number, line in enumerate(psnr)])
    return {
        "q_global": 10 * np.log10(255**2 / (error**2).mean()),
        "q_ctc_psnr": psnr.mean(),
        "q_ctc_min": psnr.min(),
        "q_ctc_step": np.sqrt((np.diff(path) ** 2).mean()),
        "q_ctc_ssim": ssim.mean(),
    }


def codes(rgb):
    """Return Y, Cb and Cr of 8-bit RGB as whole codes of 10 bit, video range."""
    ten = np.floor(rgb * (1023 / 255) + 0.5) / 1023
    red, green, blue = np.moveaxis(ten, -1, 0)
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    parts = 876 * luma + 64, 896 * (blue - luma) / 1.8556 + 512, 896 * (red - luma) / 1.5748 + 512
    return np.stack([np.floor(part + 0.5) for part in parts], axis=-1)


def structural(x, y):
    """Return SSIM with a Gaussian window of 1.5 pixels, 11×11 samples, and repeated borders."""

    def mean(image):
        return gaussian_filter(image, 1.5, truncate=5 / 1.5, mode="nearest")

    mx, my = mean(x), mean(y)
    vx, vy, both = mean(x * x) - mx**2, mean(y * y) - my**2, mean(x * y) - mx * my
    c1, c2 = (0.01 * 1023) ** 2, (0.03 * 1023) ** 2
    return (((2 * mx * my + c1) * (2 * both + c2)) / ((mx**2 + my**2 + c1) * (vx + vy + c2))).mean()


def rates(anchor, result, measure):
    """Return the Bjøntegaard rate of every picture in %, log rate by Akima's interpolation over quality."""
    found = {}
    for one, other in zip(anchor["pictures"], result["pictures"], strict=True):
        curves = []
        for row in (one, other):
            points = sorted({(float(point[measure]), float(point["bpp"])) for point in row["points"]})
            quality, rate = np.transpose(points)
            curves.append((quality, Akima1DInterpolator(quality, np.log(rate))))
        low = max(quality[0] for quality, _ in curves)
        high = min(quality[-1] for quality, _ in curves)
        if high > low:
            mean = [quad(curve, low, high, limit=500)[0] / (high - low) for _, curve in curves]
            found[one["name"]] = 100 * (np.exp(mean[1] - mean[0]) - 1)
    return found


if __name__ == "__main__":
    main()
