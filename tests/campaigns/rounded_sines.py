"""Sines and cosines of columns against the mathematical library's, bit for bit, at random angles.

    python tests/campaigns/rounded_sines.py --millions 1000

Angles are uniform in ±π/4, ±2π, ±32768, and of sizes log-uniform from 1e-9 to 1e6, by turns.
It prints how many differ, which must be none, and how many were asked of the library.
"""

import argparse
import ctypes
import sys

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.native import lanes
from eomgen.native.compiler import NOT_JOINED
from eomgen.native.library import compiled_library

MAIN = """
#include <math.h>
#include <stdint.h>
#include <string.h>
static long long asked_of_library;
#include "sines.c"

static uint64_t state;

/* Uniform in [0, 1), by xorshift64*. */
static double uniform(void) {
    state ^= state >> 12, state ^= state << 25, state ^= state >> 27;
    return (double)(state * 2685821657736338717ULL >> 11) * 0x1p-53;
}

long compare(long long vectors, uint64_t seed) {
    const double most[] = { 0.7853981633974483, 6.283185307179586, 32768.0 };
    long different = 0;
    state = seed * 2654435761ULL + 88172645463325252ULL;
    for (long long i = 0; i < vectors; i++) {
        double x[WIDTH], s[WIDTH], k[WIDTH];
        V v, sine, cosine;
        for (int l = 0; l < WIDTH; l++) {
            const double a = 2 * uniform() - 1;
            x[l] = i % 4 < 3 ? a * most[i % 4] : copysign(exp(34.5 * fabs(a) - 20.7), a);
        }
        memcpy(&v, x, sizeof v);
        sine_and_cosine(v, &sine, &cosine);
        for (int l = 0; l < WIDTH; l++) s[l] = sin(x[l]), k[l] = cos(x[l]);
        different += memcmp(&sine, s, sizeof s) != 0 || memcmp(&cosine, k, sizeof k) != 0;
    }
    return different;
}

long long asked(void) {
    return asked_of_library;
}
"""
COUNTED = "        asked &= asked - 1;\n"


def main() -> int:
    """Compare, a million vectors at a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--millions", type=int, default=10, help="angles, in millions [10]")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    each = {"each": [(name, c.C_NAMES.get(name, name)) for name in c.EACH]}
    text = render(c.TEMPLATES, "vector.c.jinja", each)
    text += render(c.TEMPLATES, "rounded_sine.c.jinja", {})
    assert COUNTED in text
    texts = {"sines.c": text.replace(COUNTED, COUNTED + "        asked_of_library++;\n")}
    texts["main.c"] = MAIN
    width = lanes.width()
    flags = (f"-DWIDTH={width}", *lanes.FLAGS[width], NOT_JOINED)
    library = compiled_library(f"sines {texts} {flags}", lambda: texts, "main.c", *flags)
    library.compare.argtypes, library.compare.restype = (
        [ctypes.c_longlong, ctypes.c_uint64],
        ctypes.c_long,
    )
    library.asked.restype = ctypes.c_longlong
    different = 0
    for i in range(asked.millions):
        different += library.compare(10**6 // width, 1000 * asked.seed + i)
    count = 2 * asked.millions * (10**6 // width) * width
    share = library.asked() / count
    print(f"{count} sines and cosines: {different} vectors differ; {share:.1%} by the library")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
