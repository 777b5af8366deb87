// Builds the charts; those of one group share zoom, pan and cursor.
const views = [];
const groups = new Map();

// Labels of a linear axis; the library's own keep three decimals, which makes neighbours of small values equal.
function tickLabels(u, splits) {
  const small = Math.max(...splits.map(Math.abs)) < 0.1;
  return splits.map(v => (v === null ? "" : small ? shortNumber(v) : uPlot.fmtNum(v)));
}

function finiteExtent(values, from, to, accept) {
  let low = Infinity, high = -Infinity;
  for (let i = from; i < to; i++) {
    const v = values[i];
    if (accept(v)) { if (v < low) low = v; if (v > high) high = v; }
  }
  return [low, high];
}

function dataExtent(view) {
  let low = Infinity, high = -Infinity;
  const take = (a, b) => { low = Math.min(low, a); high = Math.max(high, b); };
  for (const c of view.curves) take(...finiteExtent(c.x, 0, c.x.length, isNumber));
  for (const lane of view.spec.lanes) for (const [from, to] of lane.spans) take(from, to);
  if (!(low <= high)) return [0, 1];
  if (low === high) return [low - 0.5, high + 0.5];
  // Points on the border would be cut in half.
  const margin = view.curves.length && view.curves.every(c => c.spec.style === "points") ? 0.02 * (high - low) : 0;
  return [low - margin, high + margin];
}

// The vertical range that fits what is visible, with room for the labels at the top.
function fitOrdinate(view) {
  const { u, spec } = view;
  if (spec.lanes.length) { u.setScale("y", { min: 0, max: 1 }); return; }
  let low = Infinity, high = -Infinity;
  for (const curve of view.curves) {
    if (!curve.show) continue;
    const [from, to] = visibleRange(view, curve);
    const [a, b] = finiteExtent(curve.y, from, to, v => drawable(view, v));
    low = Math.min(low, a); high = Math.max(high, b);
  }
  if (spec.yRange) [low, high] = spec.yRange;
  for (const level of spec.levels) if (!spec.yRange && drawable(view, level.y)) { low = Math.min(low, level.y); high = Math.max(high, level.y); }
  if (!(low <= high)) { low = spec.scale === "log" ? 0.1 : 0; high = 1; }
  if (spec.scale === "log") { u.setScale("y", { min: low / 1.5, max: high === low ? high * 10 : high * 1.5 }); return; }
  if (spec.scale === "asinh") { u.setScale("y", { min: low < 0 ? low * 1.5 : -0.35 * spec.linearBelow, max: Math.max(high, spec.linearBelow) * 2.5 }); return; }
  if (low === high) { const half = Math.abs(low) * 0.1 || 1; low -= half; high += half; }
  const rows = (spec.bands.length ? 17 : 0) + (view.markers.some(m => m.spec.marks.some(([, label]) => label)) ? 17 : 0);
  const inner = Math.max(60, spec.height - 60), span = (high - low) * 1.08;
  const headroom = span * rows / Math.max(40, inner - rows);
  u.setScale("y", { min: low - (high - low) * 0.04, max: high + (high - low) * 0.04 + headroom });
}

function zoomTo(view, min, max) {
  const [low, high] = view.group.extent, span = Math.min(max - min, high - low);
  if (!(span > (high - low) * 1e-7)) return;
  min = Math.max(low, Math.min(min, high - span));
  view.u.setScale("x", { min, max: min + span });
}

function reset(group) { for (const view of group.views) view.u.setScale("x", { min: group.extent[0], max: group.extent[1] }); }

function onScale(view, key) {
  if (key !== "x") return;
  const { min, max } = view.u.scales.x;
  // Not at once: uPlot forgets a scale that is set while it is setting scales.
  queueMicrotask(() => fitOrdinate(view));
  for (const other of view.group.views) {
    const x = other.u && other.u.scales.x;
    if (other !== view && x && (x.min !== min || x.max !== max)) other.u.setScale("x", { min, max });
  }
}

function bindEvents(view) {
  const { over } = view.u;
  over.addEventListener("mousedown", down => {
    if (down.button !== 0 || !down.shiftKey) return;
    down.preventDefault();
    const { min, max } = view.u.scales.x, perPixel = (max - min) / over.clientWidth;
    over.classList.add("panning");
    const move = e => { const d = (down.clientX - e.clientX) * perPixel; zoomTo(view, min + d, max + d); };
    const up = () => { over.classList.remove("panning"); removeEventListener("mousemove", move); removeEventListener("mouseup", up); };
    addEventListener("mousemove", move);
    addEventListener("mouseup", up);
  });
  over.addEventListener("wheel", e => {
    const { min, max } = view.u.scales.x, span = max - min;
    if (e.ctrlKey || e.metaKey) {
      e.preventDefault();
      const factor = Math.exp(Math.max(-60, Math.min(60, e.deltaY)) * 0.004), at = view.u.posToVal(view.u.cursor.left, "x");
      zoomTo(view, at - (at - min) * factor, at + (max - at) * factor);
    } else if (e.shiftKey || Math.abs(e.deltaX) > Math.abs(e.deltaY)) {
      e.preventDefault();
      const d = (e.deltaX || e.deltaY) * span / over.clientWidth;
      zoomTo(view, min + d, max + d);
    }
  }, { passive: false });
  view.plot.addEventListener("keydown", e => {
    const { min, max } = view.u.scales.x, span = max - min, key = e.key;
    if (key === "ArrowLeft") zoomTo(view, min - span / 8, max - span / 8);
    else if (key === "ArrowRight") zoomTo(view, min + span / 8, max + span / 8);
    else if (key === "+" || key === "=") zoomTo(view, min + span / 6, max - span / 6);
    else if (key === "-") zoomTo(view, min - span / 4, max + span / 4);
    else if (key === "0" || key === "Home" || key === "Escape") reset(view.group);
    else return;
    e.preventDefault();
  });
}

function axis(label, extra) {
  const soft = () => isDark() ? "#a3adb8" : "#5a636d", grid = () => isDark() ? "#ffffff14" : "#00000012";
  return Object.assign({ stroke: soft, label, labelSize: 18, labelGap: 2, gap: 4, font: `11px ${FONT}`, labelFont: `12px ${FONT}`,
    grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1, size: 5 }, border: { show: true, stroke: soft, width: 1 } }, extra);
}

function options(view) {
  const { spec } = view, lanes = spec.lanes.length > 0, keep = (u, min, max) => [min, max];
  const distr = { linear: 1, log: 3, asinh: 4 }[spec.scale];
  const y = Object.assign({ auto: false, distr, range: keep }, distr === 4 ? { asinh: spec.linearBelow } : {});
  const cursor = { drag: { x: true, y: false, dist: 4 }, y: Boolean(spec.parametric), points: { show: false },
    bind: {
      mousedown: (u, target, handler) => e => { if (e.button === 0 && !e.shiftKey) handler(e); },
      dblclick: () => () => { reset(view.group); return null; },
    } };
  if (spec.group) cursor.sync = { key: "stylet-" + spec.group, scales: ["x", null], setSeries: false,
    filters: { pub: type => type === "mousemove" || type === "mouseleave" } };
  return {
    width: Math.max(240, view.plot.clientWidth), height: spec.height, legend: { show: false }, padding: [8, 14, 0, 0], cursor,
    scales: { x: { time: false, auto: false, range: keep }, y }, series: [{}],
    axes: [axis(spec.x, { size: 30, space: 60, values: tickLabels }),
      axis(lanes ? "" : spec.y, { scale: "y", size: 52, space: spec.height < 180 ? 24 : 32, grid: lanes ? { show: false } : axis().grid,
        labelSize: lanes ? 18 : 18, values: lanes ? () => [] : distr === 1 ? tickLabels : (u, splits) => splits.map(v => v === null ? "" : shortNumber(v)),
        splits: distr === 4 ? u => asinhSplits(u, spec.linearBelow) : undefined, filter: distr === 4 ? (u, splits) => splits : undefined })],
    hooks: {
      drawClear: [u => { if (spec.bands.length) { u.ctx.save(); clipToPlot(u); drawBands(view); u.ctx.restore(); } }],
      draw: [() => { drawAll(view); placeCover(view); }],
      setScale: [(u, key) => onScale(view, key)],
      setCursor: [() => showValues(view)],
    },
  };
}

// Ticks of an axis that is linear up to `unit` and logarithmic beyond: 1 and 3 times powers of ten inside the range, 18 px apart at least.
function asinhSplits(u, unit) {
  const { min, max } = u.scales.y, splits = [], candidates = [0];
  for (let power = Math.floor(Math.log10(unit)); Math.pow(10, power) <= Math.max(-min, max); power++) {
    for (const m of [1, 3]) {
      const size = Number(m + "e" + power);
      if (size > 0.6 * unit) candidates.push(size, -size);
    }
  }
  for (const v of candidates) {
    if (v < min || v > max) continue;
    const at = u.valToPos(v, "y");
    if (splits.every(other => Math.abs(u.valToPos(other, "y") - at) >= 18)) splits.push(v);
  }
  return splits.sort((a, b) => a - b);
}

function build(spec, number) {
  const view = { spec, plot: document.getElementById("plot-" + number), legend: document.getElementById("legend-" + number), repaint: [],
    curves: spec.series.map(s => ({ spec: s, x: payload.columns[s.x], y: payload.columns[s.y], show: !s.hidden })),
    markers: spec.markers.map(s => ({ spec: s, show: true })) };
  const key = spec.group === null ? number : "g" + spec.group;
  if (!groups.has(key)) groups.set(key, { name: spec.group, views: [], extent: [Infinity, -Infinity] });
  view.group = groups.get(key);
  view.group.views.push(view);
  const extent = dataExtent(view);
  view.group.extent = [Math.min(view.group.extent[0], extent[0]), Math.max(view.group.extent[1], extent[1])];
  views.push(view);
}

function repaintAll() { for (const view of views) { view.repaint.forEach(paint => paint()); view.u.redraw(); } }
function resizeAll() { for (const view of views) view.u.setSize({ width: Math.max(240, view.plot.clientWidth), height: view.spec.height }); }

payload.charts.forEach(build);
for (const view of views) {
  buildLegend(view);
  view.u = new uPlot(options(view), [view.group.extent.slice()], view.plot);
  bindEvents(view);
  buildNeedle(view, views.indexOf(view));
}
for (const group of groups.values()) reset(group);
for (const button of document.querySelectorAll("button[data-reset]")) {
  button.addEventListener("click", () => groups.forEach(reset));
}
const watcher = new ResizeObserver(entries => {
  for (const { target } of entries) {
    const view = views.find(v => v.plot === target), width = Math.max(240, target.clientWidth);
    if (view && view.u.width !== width) view.u.setSize({ width, height: view.spec.height });
  }
});
for (const view of views) watcher.observe(view.plot);
darkScreen.addEventListener("change", repaintAll);
addEventListener("beforeprint", () => { printing = true; resizeAll(); repaintAll(); });
addEventListener("afterprint", () => { printing = false; resizeAll(); repaintAll(); });
