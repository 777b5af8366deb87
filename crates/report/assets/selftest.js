// With #selftest in the address the page checks that each visible curve has its colour at its samples, zooms one chart of each
// group, checks that the others follow, and records the results on the elements.
function curveSeen(view, curve, image) {
  const { u } = view, want = colour(curve.spec.colour), rgb = [1, 3, 5].map(i => parseInt(want.slice(i, i + 2), 16));
  const [from, to] = visibleRange(view, curve), stride = Math.max(1, Math.floor((to - from) / 400));
  const reach = Math.ceil((curve.spec.style === "points" ? curve.spec.width : 3) * uPlot.pxRatio);
  let hits = 0, tried = 0;
  for (let i = from; i < to; i += stride) {
    if (!drawable(view, curve.y[i])) continue;
    const cx = Math.round(u.valToPos(curve.x[i], "x", true)), cy = Math.round(u.valToPos(curve.y[i], "y", true));
    tried++;
    let hit = false;
    for (let dy = -reach; dy <= reach && !hit; dy++) for (let dx = -reach; dx <= reach && !hit; dx++) {
      const x = cx + dx, y = cy + dy;
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      const at = 4 * (y * image.width + x);
      hit = image.data[at + 3] > 200 && rgb.reduce((sum, c, k) => sum + Math.abs(c - image.data[at + k]), 0) < 76;
    }
    if (hit) hits++;
  }
  return hits >= Math.min(3, Math.max(1, tried));
}

function lookForCurves() {
  for (const view of views) {
    const { canvas } = view.u.ctx, image = view.u.ctx.getImageData(0, 0, canvas.width, canvas.height);
    const visible = view.curves.filter(c => c.show), missing = visible.filter(c => !curveSeen(view, c, image));
    view.plot.dataset.seen = visible.length - missing.length;
    view.plot.dataset.missing = missing.map(c => c.spec.name).join("|");
  }
}

const pause = () => new Promise(done => setTimeout(done, 20));
const near = (a, b) => Math.abs(a - b) <= 1e-9 * (1 + Math.abs(b));

// Drags a mouse over the plot of one chart; the others must show the same stretch. A double click must bring all back.
async function dragAndReset(group) {
  const first = group.views[0], over = first.u.over, box = over.getBoundingClientRect();
  const mouse = (type, part, target) => target.dispatchEvent(new MouseEvent(type,
    { bubbles: true, cancelable: true, view: window, button: 0, movementX: 9, clientX: box.left + part * box.width, clientY: box.top + 20 }));
  const at = v => group.views.every(view => near(view.u.scales.x.min, v[0]) && near(view.u.scales.x.max, v[1]));
  mouse("mousemove", 0.25, over); mouse("mousedown", 0.25, over);
  mouse("mousemove", 0.75, over); await pause(); mouse("mouseup", 0.75, document);
  await pause();
  const { min, max } = first.u.scales.x, part = (max - min) / (group.extent[1] - group.extent[0]);
  const zoomed = part > 0.48 && part < 0.52 && at([min, max]);
  const lines = first.curves.filter(c => c.show && c.spec.style !== "points"), reads = lines.length === 0 || lines.some(c => c.output.textContent !== "");
  mouse("dblclick", 0.5, over);
  await pause();
  const verdict = !zoomed ? "no zoom" : !reads ? "no values" : !at(group.extent) ? "no reset" : "ok";
  for (const view of group.views) view.plot.dataset.moves = verdict;
}

async function selfTest() {
  lookForCurves();
  for (const group of groups.values()) await dragAndReset(group);
}

setTimeout(async () => {
  if (location.hash === "#selftest") await selfTest();
  document.documentElement.dataset.ready = String(views.length);
}, 50);
