// The legend of a chart: names that switch curves on and off, and the values under the cursor.
function element(tag, className, parent) {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (parent) parent.appendChild(e);
  return e;
}

function swatch(spec, vertical) {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  svg.setAttribute("aria-hidden", "true");
  svg.setAttribute("width", vertical ? 10 : 22);
  svg.setAttribute("height", 14);
  const shape = document.createElementNS(ns, spec.style === "points" ? "circle" : spec.style === "fill" ? "rect" : "line");
  const set = attributes => { for (const name in attributes) shape.setAttribute(name, attributes[name]); };
  if (spec.style === "points") set({ cx: 11, cy: 7, r: 4.5 });
  else if (spec.style === "fill") set({ x: 2, y: 1, width: 18, height: 12, rx: 2 });
  else set(vertical ? { x1: 5, x2: 5, y1: 0, y2: 14 } : { x1: 0, x2: 22, y1: 7, y2: 7 });
  svg.appendChild(shape);
  svg.paint = () => {
    const fill = spec.style === "points" || spec.style === "fill";
    set({ fill: fill ? colour(spec.colour) : "none", stroke: fill ? "none" : colour(spec.colour), "stroke-width": 2.4,
      "stroke-dasharray": fill ? "" : DASHES[spec.style].map(d => d * 0.8).join(" ") });
  };
  svg.paint();
  return svg;
}

function toggle(view, item, target, button) {
  target.show = !target.show;
  button.setAttribute("aria-pressed", String(target.show));
  fitOrdinate(view);
  view.u.redraw();
}

function legendItem(view, target, vertical) {
  const button = element("button", "item", view.legend);
  button.type = "button";
  button.setAttribute("aria-pressed", String(target.show));
  const icon = button.appendChild(swatch(target.spec, vertical));
  element("span", "", button).textContent = target.spec.name;
  button.addEventListener("click", () => toggle(view, icon, target, button));
  view.repaint.push(icon.paint);
  return button;
}

function buildLegend(view) {
  for (const curve of view.curves) {
    curve.output = element("output", "", legendItem(view, curve, false));
    curve.dot = null;
  }
  for (const set of view.markers) legendItem(view, set, true);
  const seen = new Set();
  for (const lane of view.spec.lanes) for (const [, , label, name] of lane.spans) {
    if (seen.has(label)) continue;
    seen.add(label);
    const item = element("span", "item", view.legend), icon = item.appendChild(swatch({ style: "fill", colour: name }, false));
    element("span", "", item).textContent = label;
    view.repaint.push(icon.paint);
  }
  view.reading = element("output", "", view.legend);
}

function shortNumber(v) {
  if (v === 0) return "0";
  const size = Math.abs(v);
  return (size >= 1e6 || size < 1e-3) ? v.toExponential(2) : String(Number(v.toPrecision(4)));
}

// Index of the sample that the cursor means: the nearest one, the step that holds, or the nearest on the picture.
function indexUnder(view, curve, x) {
  const { u } = view, n = curve.x.length;
  if (n === 0) return -1;
  if (view.spec.parametric) {
    const yValue = u.posToVal(u.cursor.top, "y");
    const sx = 1 / (u.scales.x.max - u.scales.x.min), sy = 1 / (u.scales.y.max - u.scales.y.min);
    let best = -1, least = Infinity;
    for (let i = 0; i < n; i++) {
      if (!isNumber(curve.x[i]) || !isNumber(curve.y[i])) continue;
      const dx = (curve.x[i] - x) * sx, dy = (curve.y[i] - yValue) * sy, d = dx * dx * 9 + dy * dy;
      if (d < least) { least = d; best = i; }
    }
    return best;
  }
  const after = lowerBound(curve.x, x);
  if (curve.spec.style === "step") return (curve.x[after] === x ? after : after - 1);
  const before = Math.max(0, after - 1), nearest = after >= n || x - curve.x[before] < curve.x[after] - x ? before : after;
  if (curve.spec.style !== "points") return nearest;
  return Math.abs(u.valToPos(curve.x[nearest], "x") - u.cursor.left) < 8 ? nearest : -1;
}

function showValues(view) {
  const { u, spec } = view, over = u.cursor.left >= 0 && u.cursor.top >= 0 || u.cursor.left >= 0 && !spec.parametric;
  const x = over ? u.posToVal(u.cursor.left, "x") : null;
  for (const curve of view.curves) {
    const i = over && curve.show ? indexUnder(view, curve, x) : -1, known = i >= 0 && isNumber(curve.y[i]);
    curve.output.textContent = known ? shortNumber(curve.y[i]) : "";
    if (!known) { if (curve.dot) curve.dot.style.display = "none"; continue; }
    if (!curve.dot) curve.dot = element("div", "dot", u.over);
    const at = curve.spec.style === "step" ? x : curve.x[i];
    Object.assign(curve.dot.style, { display: "block", background: colour(curve.spec.colour), left: u.valToPos(at, "x") + "px", top: u.valToPos(curve.y[i], "y") + "px" });
  }
  const states = spec.lanes.map(lane => {
    const span = over && lane.spans.find(([from, to]) => from <= x && x < to);
    return span ? (lane.name ? lane.name + ": " : "") + span[2] : "";
  });
  view.reading.textContent = over ? [`${spec.x.replace(/ \(.*/, "")} ${shortNumber(x)}`, ...states].filter(Boolean).join("   ") : "";
}
