"""Curves as SVG, by the standard library alone."""

import html

INK, SOFT, LINE, BLUE, GREY, ORANGE = "#1b1f24", "#5a636d", "#d9dde2", "#0072b2", "#9aa3ad", "#d55e00"
FONT = "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"
# A row of panels: width and height of the picture, and the edges of the axes.
WIDTH, HEIGHT, TOP, BOTTOM = 760, 250, 66, 60


def thin(points, tolerance):
    """Douglas-Peucker: the polyline with fewer points, each within `tolerance` of it."""
    if len(points) < 3:
        return points
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        (x0, y0), (x1, y1) = points[a], points[b]
        length = ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
        worst, at = 0.0, None
        for k in range(a + 1, b):
            x, y = points[k]
            d = abs((x1 - x0) * (y0 - y) - (x0 - x) * (y1 - y0)) / length if length else ((x - x0) ** 2 + (y - y0) ** 2) ** 0.5
            if d > worst:
                worst, at = d, k
        if at is not None and worst > tolerance:
            keep.add(at)
            stack += [(a, at), (at, b)]
    return [points[k] for k in sorted(keep)]


def path(points, tolerance=0.25):
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in thin(points, tolerance))


def extremes(points):
    """The lowest and the highest point of each column of pixels: noise looks the same, with fewer points."""
    columns = {}
    for k, (x, y) in enumerate(points):
        columns.setdefault(round(x), []).append((y, k))
    keep = sorted({k for column in columns.values() for _, k in (min(column), max(column))})
    return [points[k] for k in keep]


def ticks(low, high, wanted=4):
    step = next(s for e in range(-6, 6) for s in (1 * 10.0**e, 2 * 10.0**e, 5 * 10.0**e) if (high - low) / s <= wanted)
    first = int(low / step) - 1
    return [k * step for k in range(first, first + wanted + 4) if low - 1e-9 <= k * step <= high + 1e-9]


def text(x, y, words, anchor="start", style=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{style}>{html.escape(words)}</text>'


def heading(x, title, entries):
    """The title of a panel, and below it its legend: (colour, text); an entry without a colour is text only."""
    out = [text(x, 42, title, style=' class="h"')]
    for colour, words in entries:
        if colour:
            out.append(f'<path d="M{x:.0f} 54h12" stroke="{colour}" stroke-width="2.5"/>')
            x += 16
        out.append(text(x, 58, words))
        x += 6.6 * len(words) + 10
    return out


def panel(series, x_label, y_label, left, width, y_range=None, band=None):
    """Curves (colour, x, y) over common axes, cut off at `y_range`; a grey band from -`band` to `band`."""
    right, floor = left + width, HEIGHT - BOTTOM
    xs = [v for s in series for v in s[1]]
    x0, x1 = min(xs), max(xs)
    y0, y1 = y_range or limits([s[2] for s in series])
    px = lambda x: left + (x - x0) / (x1 - x0) * width
    py = lambda y: floor - (min(max(y, y0), y1) - y0) / (y1 - y0) * (floor - TOP)
    out = []
    if band:
        out.append(f'<path d="M{left} {py(band):.1f}H{right}V{py(-band):.1f}H{left}Z" style="fill:{LINE}"/>')
    for x in ticks(x0, x1, 6):
        out.append(f'<path d="M{px(x):.1f} {TOP}V{floor}" stroke="{LINE}"/>' + text(px(x), floor + 14, f"{x:g}", "middle"))
    for y in ticks(y0, y1, 5):
        out.append(f'<path d="M{left} {py(y):.1f}H{right}" stroke="{LINE}"/>' + text(left - 5, py(y) + 4, f"{y:.6g}", "end"))
    out.append(text(left + width / 2, floor + 30, x_label, "middle"))
    out.append(f'<text transform="translate({left - 36} {(TOP + floor) / 2}) rotate(-90)" text-anchor="middle">{y_label}</text>')
    for colour, x, y in series:
        out.append(f'<path d="{path(extremes([(px(a), py(b)) for a, b in zip(x, y)]))}" stroke="{colour}" stroke-width="1.4"/>')
    return out


def limits(curves):
    """The range of the values, with a margin of a twentieth and at least 0.01 N."""
    low, high = min(map(min, curves)), max(map(max, curves))
    margin = max(0.05 * (high - low), 0.01)
    return low - margin, high + margin


def picture(title, parts, caption=""):
    """The SVG of a row of panels with a title above and a sentence below."""
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{html.escape(title)}">',
            f"<style>text{{font:11.5px {FONT};fill:{SOFT}}}.h{{font-size:12.5px;font-weight:600;fill:{INK}}}.c{{fill:{INK}}}path{{fill:none;stroke-linejoin:round}}</style>",
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>' + text(10, 18, title, style=' class="h"'),
            *parts,
            text(WIDTH - 10, HEIGHT - 9, caption, "end", ' class="c"'),
            "</svg>\n",
        ]
    )
