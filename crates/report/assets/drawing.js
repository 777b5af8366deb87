// Draws curves, bands, markers, thresholds and lanes on the canvas of a chart. uPlot supplies axes, scales, cursor, zoom.
const payload = JSON.parse(document.getElementById("data").textContent);
const darkScreen = matchMedia("(prefers-color-scheme: dark)");
let printing = false;
const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
const CROWD = 100;
const DASHES = { solid: [], step: [], points: [], dashed: [7, 4], dotted: [1.5, 3.5] };

function isDark() { return darkScreen.matches && !printing; }
function colour(name) { return payload.palette[name][isDark() ? 1 : 0]; }
function withAlpha(hex, alpha) { return hex + Math.round(alpha * 255).toString(16).padStart(2, "0"); }
function isNumber(v) { return v !== null && v === v; }

// The first index whose value is not below v.
function lowerBound(sorted, v) {
  let low = 0, high = sorted.length;
  while (low < high) { const mid = (low + high) >> 1; if (sorted[mid] < v) low = mid + 1; else high = mid; }
  return low;
}

// Indices from, to (exclusive) that matter for the visible abscissae, with one neighbour either side.
function visibleRange(view, curve) {
  if (view.spec.parametric) return [0, curve.x.length];
  const { min, max } = view.u.scales.x;
  return [Math.max(0, lowerBound(curve.x, min) - 1), Math.min(curve.x.length, lowerBound(curve.x, max) + 1)];
}

function drawable(view, y) { return isNumber(y) && (view.spec.scale !== "log" || y > 0); }

function drawCurve(view, curve) {
  const { u } = view, { ctx } = u, ratio = uPlot.pxRatio;
  const [from, to] = visibleRange(view, curve);
  const step = curve.spec.style === "step";
  let points = 0, pen = false, lastY = 0;
  ctx.strokeStyle = ctx.fillStyle = colour(curve.spec.colour);
  ctx.lineWidth = curve.spec.width * ratio;
  ctx.lineJoin = "round";
  ctx.setLineDash(DASHES[curve.spec.style].map(d => d * ratio));
  ctx.beginPath();
  for (let i = from; i < to; i++) {
    if (!drawable(view, curve.y[i]) || !isNumber(curve.x[i])) { pen = false; continue; }
    const px = u.valToPos(curve.x[i], "x", true), py = u.valToPos(curve.y[i], "y", true);
    points++;
    if (curve.spec.style === "points") {
      ctx.moveTo(px + curve.spec.width * ratio, py);
      ctx.arc(px, py, curve.spec.width * ratio, 0, 2 * Math.PI);
      continue;
    }
    if (!pen) ctx.moveTo(px, py);
    else { if (step) ctx.lineTo(px, lastY); ctx.lineTo(px, py); }
    pen = true;
    lastY = py;
  }
  if (curve.spec.style === "points") {
    ctx.fill();
    // A rim in the background colour; with many points it would hide the points below.
    if (points > CROWD) return points;
    ctx.strokeStyle = isDark() ? "#12161b" : "#ffffff";
    ctx.lineWidth = 1.2 * ratio;
  }
  ctx.stroke();
  return points;
}

function clipToPlot(u) { u.ctx.beginPath(); u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height); u.ctx.clip(); }

// Places labels in rows without overlap.
function Rows(first, height, count) {
  const taken = Array.from({ length: count }, () => []);
  this.place = (left, width) => {
    for (let row = 0; row < count; row++) {
      if (taken[row].every(([a, b]) => left + width < a || left > b)) { taken[row].push([left, left + width]); return first + row * height; }
    }
    return null;
  };
}

function drawBands(view) {
  const { u, spec } = view, { ctx, bbox } = u;
  for (const [from, to, , name] of spec.bands) {
    const a = u.valToPos(from, "x", true), b = u.valToPos(to, "x", true);
    ctx.fillStyle = withAlpha(colour(name), isDark() ? 0.13 : 0.12);
    ctx.fillRect(a, bbox.top, b - a, bbox.height);
  }
}

function fit(ctx, text, width) {
  if (ctx.measureText(text).width <= width) return text;
  while (text.length > 3 && ctx.measureText(text + "…").width > width) text = text.slice(0, -1);
  return text.length > 3 ? text + "…" : "";
}

// A halo keeps text readable over curves.
function write(ctx, text, x, y, ink) {
  ctx.setLineDash([]);
  ctx.lineWidth = 3 * uPlot.pxRatio;
  ctx.lineJoin = "round";
  ctx.strokeStyle = isDark() ? "#12161bd0" : "#ffffffd0";
  ctx.strokeText(text, x, y);
  ctx.fillStyle = ink;
  ctx.fillText(text, x, y);
}

function drawBandLabels(view) {
  const { u, spec } = view, { ctx, bbox } = u, ratio = uPlot.pxRatio;
  ctx.font = `600 ${11.5 * ratio}px ${FONT}`;
  ctx.textAlign = "center"; ctx.textBaseline = "top";
  for (const [from, to, label] of spec.bands) {
    const a = Math.max(u.valToPos(from, "x", true), bbox.left), b = Math.min(u.valToPos(to, "x", true), bbox.left + bbox.width);
    if (b > a) write(ctx, fit(ctx, label, b - a - 8 * ratio), (a + b) / 2, bbox.top + 4 * ratio, isDark() ? "#c3ccd5" : "#3c444d");
  }
}

function drawMarkers(view) {
  const { u, spec } = view, { ctx, bbox } = u, ratio = uPlot.pxRatio;
  const rows = new Rows(bbox.top + (spec.bands.length ? 20 : 4) * ratio, 15 * ratio, 3);
  for (const set of view.markers) {
    if (!set.show) continue;
    for (const [x] of set.spec.marks) {
      const px = Math.round(u.valToPos(x, "x", true));
      ctx.strokeStyle = colour(set.spec.colour);
      ctx.lineWidth = (set.spec.style === "solid" ? 1.6 : 1.8) * ratio;
      ctx.setLineDash(DASHES[set.spec.style].map(d => d * ratio));
      ctx.beginPath(); ctx.moveTo(px, bbox.top); ctx.lineTo(px, bbox.top + bbox.height); ctx.stroke();
    }
  }
  ctx.font = `${11 * ratio}px ${FONT}`;
  ctx.textBaseline = "top";
  for (const set of view.markers) {
    if (!set.show) continue;
    for (const [x, label] of set.spec.marks) {
      if (!label) continue;
      const px = u.valToPos(x, "x", true), width = ctx.measureText(label).width + 6 * ratio;
      if (px < bbox.left || px > bbox.left + bbox.width) continue;
      let left = set.spec.side === "left" ? px - width : px + 4 * ratio;
      if (left < bbox.left) left = px + 4 * ratio;
      if (left + width > bbox.left + bbox.width) left = px - width;
      const top = rows.place(left, width);
      if (top === null) continue;
      ctx.textAlign = "left";
      write(ctx, label, left + 1 * ratio, top, colour(set.spec.colour));
    }
  }
}

function drawLevels(view) {
  const { u, spec } = view, { ctx, bbox } = u, ratio = uPlot.pxRatio;
  for (const level of spec.levels) {
    const y = u.valToPos(level.y, "y", true);
    ctx.strokeStyle = colour(level.colour);
    ctx.lineWidth = 1.3 * ratio;
    ctx.setLineDash(DASHES[level.style].map(d => d * ratio));
    ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
    ctx.font = `${11 * ratio}px ${FONT}`;
    const below = level.y < 0;
    ctx.textAlign = "right"; ctx.textBaseline = below ? "top" : "bottom";
    write(ctx, level.label, bbox.left + bbox.width - 5 * ratio, y + (below ? 3 : -2) * ratio, colour(level.colour));
  }
}

function drawLanes(view) {
  const { u, spec } = view, { ctx, bbox } = u, ratio = uPlot.pxRatio;
  const height = bbox.height / spec.lanes.length, named = spec.lanes.some(l => l.name);
  let spans = 0;
  spec.lanes.forEach((lane, row) => {
    const top = bbox.top + row * height, head = named ? 16 * ratio : 2 * ratio;
    for (const [from, to, label, name] of lane.spans) {
      const a = u.valToPos(from, "x", true), b = u.valToPos(to, "x", true), width = Math.max(b - a, 1.5 * ratio);
      ctx.fillStyle = name === "grey" ? withAlpha(colour(name), 0.35) : colour(name);
      ctx.fillRect(a, top + head, width, height - head - 2 * ratio);
      const left = Math.max(a, bbox.left), right = Math.min(b, bbox.left + bbox.width);
      ctx.font = `${11 * ratio}px ${FONT}`;
      if (right - left > ctx.measureText(label).width + 8 * ratio) {
        ctx.textAlign = "center"; ctx.textBaseline = "middle";
        ctx.fillStyle = name === "grey" ? colour("ink") : name === "ink" ? (isDark() ? "#101418" : "#ffffff") : "#101418";
        ctx.fillText(label, (left + right) / 2, top + head + (height - head) / 2 - ratio);
      }
      spans++;
    }
    if (named) {
      ctx.font = `600 ${11 * ratio}px ${FONT}`;
      ctx.textAlign = "left"; ctx.textBaseline = "top";
      write(ctx, lane.name, bbox.left + 3 * ratio, top + 2 * ratio, colour("ink"));
    }
  });
  return spans;
}

// Draws everything above the grid and records on the element what was drawn, for tests.
function drawAll(view) {
  const { u } = view, { ctx } = u;
  ctx.save();
  clipToPlot(u);
  let series = 0, points = 0;
  for (const curve of view.curves) {
    if (!curve.show) continue;
    const n = drawCurve(view, curve);
    if (n > 0) { series++; points += n; }
  }
  const spans = view.spec.lanes.length ? drawLanes(view) : 0;
  drawLevels(view);
  drawMarkers(view);
  drawBandLabels(view);
  ctx.restore();
  Object.assign(view.plot.dataset, { series, points, spans, markers: view.markers.filter(m => m.show).length });
}
