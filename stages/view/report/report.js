'use strict';
const $ = id => document.getElementById(id);
const head = JSON.parse($('head').textContent);
const layers = head.layers, shown = head.embedded;  // indices into layers that this page holds
const state = { at: -1, runs: null, scale: 1, x: 0, y: 0 };  // x, y: pixel of the image in the middle of the view
const mm = nm => +(nm / 1e6).toFixed(6);
const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const element = (name, text, parent) => {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
};

// --- data: base64 of deflated bytes, unpacked when it is shown
async function unpack(id) {
  const bytes = Uint8Array.from(atob($(id).textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The code of stages/view/report/run_code.h.
function decodeRuns(code, rows) {
  let at = 0;
  const number = () => {
    let value = 0, unit = 1, byte;
    do { byte = code[at++]; value += (byte & 127) * unit; unit *= 128; } while (byte > 127);
    return value;
  };
  const rowOffset = new Uint32Array(rows + 1), change = [];
  let first = 0, last = 0;  // the row before is change[first .. last)
  for (let row = 0; row < rows;) {
    const tag = number();
    if (tag === 0) {
      for (let again = number(); again > 0; --again) {
        const begin = change.length;
        for (let i = first; i < last; ++i) change.push(change[i]);
        first = begin; last = change.length;
        rowOffset[++row] = last;
      }
      continue;
    }
    const begin = change.length;
    if (tag === 1) {
      const moved = folded => folded % 2 ? -(folded + 1) / 2 : folded / 2;
      for (let i = first; i < last; i += 2) {
        const pair = code[at++], wide = pair === 255;
        if (pair > 224 && !wide) {  // so many runs stay
          for (const stay = i + 2 * (pair - 223); i < stay; ++i) change.push(change[i]);
          i -= 2;
          continue;
        }
        const begin = wide ? number() : Math.floor(pair / 15), end = wide ? number() : pair % 15;
        change.push(change[i] + moved(begin), change[i + 1] + moved(end));
      }
    } else {
      for (let left = tag - 2, column = 0; left > 0; --left) change.push(column += number());
    }
    first = begin; last = change.length;
    rowOffset[++row] = last;
  }
  return { rowOffset, change: Uint32Array.from(change) };
}
const decodeLayer = async index => decodeRuns(await unpack('r' + index), head.rows);

// --- the layer
const view = $('view');
const pixel_aspect = head.pixel_mm[1] / head.pixel_mm[0];  // a pixel is 1 wide and so much high
function size(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2), box = canvas.getBoundingClientRect();
  const width = Math.max(1, Math.round(box.width * ratio)), height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
}

function drawView() {
  if (!state.runs) return;
  size(view);
  const width = view.width, height = view.height, sx = state.scale, sy = state.scale * pixel_aspect;
  const left = state.x - width / 2 / sx, top = state.y - height / 2 / sy;
  const share = new Float32Array(width * height);
  const { rowOffset, change } = state.runs;
  const fill = (line, begin, end, weight) => {  // begin, end: in pixels of the view
    begin = Math.max(0, begin); end = Math.min(width, end);
    if (end <= begin) return;
    const a = Math.floor(begin), b = Math.floor(end), at = line * width;
    if (a === b) { share[at + a] += (end - begin) * weight; return; }
    share[at + a] += (a + 1 - begin) * weight;
    for (let x = a + 1; x < b; ++x) share[at + x] += weight;
    if (b < width) share[at + b] += (end - b) * weight;
  };
  const firstRow = Math.max(0, Math.floor(top)), lastRow = Math.min(head.rows, Math.ceil(top + height / sy));
  for (let row = firstRow; row < lastRow; ++row) {
    if (rowOffset[row] === rowOffset[row + 1]) continue;
    const y0 = Math.max(0, (row - top) * sy), y1 = Math.min(height, (row + 1 - top) * sy);
    for (let line = Math.floor(y0); line < y1; ++line) {
      const weight = Math.min(y1, line + 1) - Math.max(y0, line);
      for (let i = rowOffset[row]; i < rowOffset[row + 1]; i += 2) {
        fill(line, (change[i] - left) * sx, (change[i + 1] - left) * sx, weight);
      }
    }
  }
  const pen = view.getContext('2d'), image = pen.createImageData(width, height);
  const parts = name => [1, 3, 5].map(at => parseInt(colour(name).slice(at, at + 2), 16));  // of #rrggbb
  const ink = parts('--ink'), ground = parts('--ground'), outside = parts('--panel');
  const bedLeft = -left * sx, bedRight = (head.columns - left) * sx, bedTop = -top * sy, bedBottom = (head.rows - top) * sy;
  for (let y = 0, at = 0; y < height; ++y) {
    const within = y >= bedTop && y < bedBottom;
    for (let x = 0; x < width; ++x, ++at) {
      const under = within && x >= bedLeft && x < bedRight ? ground : outside, part = Math.min(1, share[at]);
      for (let k = 0; k < 3; ++k) image.data[4 * at + k] = under[k] + (ink[k] - under[k]) * part;
      image.data[4 * at + 3] = 255;
    }
  }
  pen.putImageData(image, 0, 0);
  drawLocations(pen, left, top, sx, sy);
}

// Frames around what --inspect found in the layer at hand.
function locationsOf(number) { return head.locations.filter(spot => spot.layers[0] <= number && number <= spot.layers[1]); }
function drawLocations(pen, left, top, sx, sy) {
  const frames = locationsOf(head.first_layer + (shown[state.at] ?? 0)).map(spot => {
    const [x, y, width, depth] = spot.box_mm, minimum = 14;
    const w = Math.max(minimum, width / head.pixel_mm[0] * sx + 8), h = Math.max(minimum, depth / head.pixel_mm[1] * sy + 8);
    return [(x / head.pixel_mm[0] - left) * sx - w / 2, (y / head.pixel_mm[1] - top) * sy - h / 2, w, h];
  });
  pen.strokeStyle = colour('--bad'); pen.lineWidth = 3;
  for (const frame of frames) pen.strokeRect(...frame);
  state.frames = frames;
}
async function showLocation(spot) {
  await showLayer(spot.layers[0]);
  const [x, y, width, depth] = spot.box_mm;
  state.x = x / head.pixel_mm[0]; state.y = y / head.pixel_mm[1];
  const across = Math.max(width, depth / 2, 2) * 4 / head.pixel_mm[0];  // of the view: four times the place
  state.scale = Math.min(64, Math.max(state.scale, view.width / across));
  drawView();
  view.scrollIntoView({ block: 'center' });
}

function fit() {
  size(view);
  const [l, t, r, b] = head.window;
  state.x = (l + r) / 2; state.y = (t + b) / 2;
  state.scale = 0.94 * Math.min(view.width / Math.max(1, r - l), view.height / (Math.max(1, b - t) * pixel_aspect));
  drawView();
}
function zoom(factor, px = view.width / 2, py = view.height / 2) {
  const scale = Math.min(64, Math.max(1e-3, state.scale * factor));
  state.x += (px - view.width / 2) * (1 / state.scale - 1 / scale);
  state.y += (py - view.height / 2) * (1 / state.scale - 1 / scale) / pixel_aspect;
  state.scale = scale;
  drawView();
}
function pan(dx, dy) { state.x -= dx / state.scale; state.y -= dy / (state.scale * pixel_aspect); drawView(); }

let wanted = 0;
async function show(spot) {  // place: within `shown`
  spot = Math.max(0, Math.min(shown.length - 1, spot));
  const requested = ++wanted, runs = await decodeLayer(shown[spot]);
  if (requested !== wanted) return;
  state.at = spot; state.runs = runs;
  const i = shown[spot];
  $('slider').value = spot; $('number').value = head.first_layer + i;
  $('readout').textContent = `z ${mm(layers.bottom[i])} to ${mm(layers.bottom[i] + layers.thickness[i])} mm, ` +
    `${(layers.set[i] * head.pixel_mm[0] * head.pixel_mm[1]).toFixed(2)} mm², ` +
    (head.images ? `${layers.set[i].toLocaleString('en')} pixels` : `${layers.volume[i].toFixed(3)} mm³ in beads`) +
    (layers.seconds ? `, about ${duration(layers.seconds[i])}` : '') +
    locationsOf(head.first_layer + i).map(spot => `, ${spot.code}`).filter((code, k, all) => all.indexOf(code) === k).join('');
  if (!state.fitted) { state.fitted = true; fit(); } else drawView();
  drawPlots();
  document.documentElement.dataset.layer = head.first_layer + i;
}
function showLayer(number) {  // the nearest that the page holds
  const i = number - head.first_layer;
  let best = 0;
  shown.forEach((have, spot) => { if (Math.abs(have - i) < Math.abs(shown[best] - i)) best = spot; });
  return show(best);
}

// --- from three sides
async function drawViews() {
  $('about-views').textContent = head.views.top[2] === 0 ? 'The part files, lit from the upper left.' :
    'As the layers build it up, lighter where it is nearer.';
  for (const [name, title] of [['top', 'from above'], ['front', 'from the front'], ['side', 'from the right']]) {
    const figure = element('figure', undefined, $('views'));
    element('figcaption', title, figure);
    const canvas = element('canvas', undefined, figure), [width, height, maximum] = head.views[name];
    canvas.setAttribute('role', 'img'); canvas.setAttribute('aria-label', 'the parts ' + title);
    const bytes = await unpack('v-' + name);
    const picture = document.createElement('canvas');
    picture.width = width; picture.height = height;
    const pen = picture.getContext('2d'), image = pen.createImageData(width, height);
    const paint = (at, light, cover) => image.data.set([35 + 190 * light, 55 + 185 * light, 80 + 172 * light, cover], 4 * at);
    if (maximum === 0) {  // ray-cast: for each pixel how light, and how much of it is part
      for (let at = 0; at < width * height; ++at) paint(at, bytes[2 * at] / 255, bytes[2 * at + 1]);
    } else {  // the layers: depth, lighter where it is nearer
      const depth = new Uint16Array(bytes.buffer, 0, width * height);
      for (let y = 0, at = 0; y < height; ++y) {
        for (let x = 0; x < width; ++x, ++at) {
          if (!depth[at]) continue;
          const right = x + 1 < width && depth[at + 1] ? depth[at + 1] - depth[at] : 0;
          const below = y + 1 < height && depth[at + width] ? depth[at + width] - depth[at] : 0;
          paint(at, 0.4 + 0.4 * depth[at] / maximum + Math.max(-0.25, Math.min(0.2, (right + below) * 10 / maximum)), 255);
        }
      }
    }
    pen.putImageData(image, 0, 0);
    const draw = () => {
      size(canvas);
      const [w, h] = head.views[name].slice(3), scale = Math.min(canvas.width / w, canvas.height / h) * 0.92;
      const to = canvas.getContext('2d');
      to.clearRect(0, 0, canvas.width, canvas.height);
      to.drawImage(picture, (canvas.width - w * scale) / 2, (canvas.height - h * scale) / 2, w * scale, h * scale);
    };
    redraw.push(draw);
  }
  redraw.forEach(draw => draw());  // now that all have their places: the first alone would be as wide as the page
}

// --- over the height
const plots = [], redraw = [];
function addPlot(title, unit, values) {
  const figure = element('figure', undefined, $('plots')), maximum = values.reduce((a, b) => Math.max(a, b), 0);
  const minimum = values.reduce((a, b) => Math.min(a, b), Infinity);
  element('figcaption', `${title}: ${+minimum.toPrecision(6)} to ${+maximum.toPrecision(6)} ${unit}`, figure);
  const canvas = element('canvas', undefined, figure);
  canvas.setAttribute('role', 'img'); canvas.setAttribute('aria-label', title + ' against height');
  plots.push({ canvas, values, maximum: maximum || 1 });
  canvas.addEventListener('click', event => {
    const box = canvas.getBoundingClientRect(), z = (event.clientX - box.left) / box.width * height();
    let i = 0;
    while (i + 1 < layers.bottom.length && layers.bottom[i + 1] - layers.bottom[0] <= z) ++i;
    showLayer(head.first_layer + i);
  });
}
const height = () => layers.bottom.at(-1) + layers.thickness.at(-1) - layers.bottom[0];
function drawPlots() {
  for (const { canvas, values, maximum } of plots) {
    size(canvas);
    const pen = canvas.getContext('2d'), w = canvas.width, h = canvas.height, all = height();
    const x = nm => (nm - layers.bottom[0]) / all * w, y = value => h - 4 - value / maximum * (h - 12);
    pen.clearRect(0, 0, w, h);
    const i = shown[state.at] ?? 0;
    pen.fillStyle = colour('--accent'); pen.globalAlpha = 0.35;
    pen.fillRect(x(layers.bottom[i]) - 1, 0, Math.max(3, x(layers.bottom[i] + layers.thickness[i]) - x(layers.bottom[i])), h);
    pen.globalAlpha = 1;
    pen.strokeStyle = colour('--ink'); pen.lineWidth = 1.5;
    pen.beginPath();
    for (let k = 0; k < values.length; ++k) {
      pen.lineTo(x(layers.bottom[k]), y(values[k]));
      pen.lineTo(x(layers.bottom[k] + layers.thickness[k]), y(values[k]));
    }
    pen.stroke();
  }
}

// --- texts
const duration = s => s < 90 ? `${s.toFixed(1)} s` : s < 5400 ? `${(s / 60).toFixed(1)} min` : `${(s / 3600).toFixed(2)} h`;
function fillTexts() {
  $('title').textContent = head.title;
  $('facts').textContent = `${head.layer_count.toLocaleString('en')} layers, ` + (head.images ?
    `${head.columns} × ${head.rows} pixels of ${+head.dpi[0].toFixed(3)} × ${+head.dpi[1].toFixed(3)} dpi, ` :
    `drawn in pixels of ${Math.round(head.pixel_mm[0] * 1000)} µm, `) + head.format + (head.machine ? `, ${head.machine}, about ${duration(layers.seconds.reduce((a, b) => a + b, 0))}` : '') + (head.sweeps ? `; sweeps: ${head.sweeps}` : '');
  if (head.stride > 1) $('note').textContent = `To keep this page small, every ${head.stride}th layer can be inspected at.`;
  const warnings = $('warnings'), warn = (text, layer) => {
    const line = element('li', layer === undefined ? text : undefined, warnings);
    if (layer === undefined) return;
    const button = element('button', text, line);
    button.type = 'button';
    button.addEventListener('click', () => { showLayer(layer); view.scrollIntoView({ block: 'center' }); });
  };
  for (const warning of head.warnings) warn(warning.text, warning.layer);
  for (const part of head.parts) for (const note of part.notes) warn(`${part.path}: ${note}`);
  let reported = 0, more = 0;
  layers.capped.forEach((rows, i) => {
    const empty = layers.set[i] === 0;
    if (!rows && !empty) return;
    if (reported++ >= 200) { ++more; return; }
    const number = head.first_layer + i;
    warn(`layer ${number}: ` + (empty ? head.images ? 'nothing is set' : 'nothing is deposited' : `${rows} rows are closed only thanks to repair`), number);
  });
  if (more) warn(`and ${more} more layers`);
  if (!warnings.children.length) warn('none');
  $('h-locations').hidden = !head.locations.length;
  for (const spot of head.locations) {
    const [x, y, z] = spot.mm.map(value => +value.toFixed(2)), unit = { mm2: 'mm²', mm3: 'mm³' }[spot.unit];
    const button = element('button', `${spot.code}` + (unit ? ` of ${+spot.amount.toPrecision(3)} ${unit}` : '') +
      ` at x ${x}, y ${y}, z ${z} mm, layer ${spot.layers[0]}` +
      (spot.layers[1] > spot.layers[0] ? ` to ${spot.layers[1]}` : ''), element('li', undefined, $('locations')));
    button.type = 'button';
    button.addEventListener('click', () => showLocation(spot));
  }
  const row = (table, cells, cell = 'td') => { const line = element('tr', undefined, table); cells.forEach(text => element(cell, text, line)); };
  row($('parts'), ['part', 'copies', 'triangles', 'from, mm', 'to, mm'], 'th');
  for (const part of head.parts) {
    row($('parts'), [part.path, part.copies, part.triangles, part.low_mm.join(', '), part.high_mm.join(', ')]);
  }
  $('cost').hidden = !head.quote.length;
  head.quote.forEach((cells, i) => row($('quote'), i ? cells : cells.map(name => name.replaceAll('_', ' ')), i ? 'td' : 'th'));
  $('job').textContent = head.job;
  $('deposited').hidden = !head.deposited;
  $('deposited-lines').textContent = head.deposited;
  if (head.deposited_svg) {
    const picture = element('img', undefined, $('deposited'));
    picture.alt = 'sections through beads and pores, across the layers and along them';
    picture.src = 'data:image/svg+xml;base64,' + head.deposited_svg;
  }
  const line = $('manifest');
  line.append(`${head.manifest.name}, ${head.manifest.bytes} bytes, XXH3-128 `);
  element('code', head.manifest.hash, line);
  line.append(`, written by lamina ${head.version}`);
  $('files').addEventListener('toggle', () => {
    const table = $('files').querySelector('table');
    if (table.rows.length) return;
    row(table, ['layer', 'bottom, mm', 'thickness, mm', 'reason', 'bytes', head.images ? 'set pixels' : 'covered pixels', 'XXH3-128'], 'th');
    layers.hash.forEach((hash, i) => row(table, [head.first_layer + i, mm(layers.bottom[i]), mm(layers.thickness[i]),
      head.reasons[layers.reason[i]], layers.bytes[i], layers.set[i], hash]));
  });
}

// --- hands
function listen() {
  $('slider').max = shown.length - 1;
  $('slider').addEventListener('input', event => show(+event.target.value));
  $('number').addEventListener('change', event => showLayer(+event.target.value));
  $('previous').addEventListener('click', () => show(state.at - 1));
  $('next').addEventListener('click', () => show(state.at + 1));
  $('closer').addEventListener('click', () => zoom(1.5));
  $('farther').addEventListener('click', () => zoom(1 / 1.5));
  $('fit').addEventListener('click', fit);
  $('pixels').addEventListener('click', () => zoom(1 / state.scale));
  $('theme').addEventListener('click', () => {
    const root = document.documentElement, now = root.dataset.theme ||
      (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
    root.dataset.theme = now === 'dark' ? 'light' : 'dark';
    drawView(); drawPlots();
  });
  document.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'INPUT') return;
    const step = { PageUp: () => show(state.at + 1), PageDown: () => show(state.at - 1), Home: () => show(0), End: () => show(shown.length - 1) };
    const inView = { ArrowLeft: () => pan(40, 0), ArrowRight: () => pan(-40, 0), ArrowUp: () => pan(0, 40),
      ArrowDown: () => pan(0, -40), '+': () => zoom(1.5), '=': () => zoom(1.5), '-': () => zoom(1 / 1.5), '0': fit };
    const act = step[event.key] || (document.activeElement === view && inView[event.key]);
    if (!act) return;
    event.preventDefault();
    act();
  });
  const ratio = () => view.width / view.getBoundingClientRect().width, fingers = new Map();
  const spot = event => { const box = view.getBoundingClientRect(); return [(event.clientX - box.left) * ratio(), (event.clientY - box.top) * ratio()]; };
  view.addEventListener('pointerdown', event => { view.setPointerCapture(event.pointerId); fingers.set(event.pointerId, spot(event)); });
  for (const name of ['pointerup', 'pointercancel']) view.addEventListener(name, event => fingers.delete(event.pointerId));
  view.addEventListener('pointermove', event => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()].map(p => [...p]), now = spot(event), old = fingers.get(event.pointerId);
    fingers.set(event.pointerId, now);
    if (before.length === 1) { pan(now[0] - old[0], now[1] - old[1]); return; }
    const after = [...fingers.values()], apart = p => Math.hypot(p[0][0] - p[1][0], p[0][1] - p[1][1]);
    if (apart(before) > 0) zoom(apart(after) / apart(before), (after[0][0] + after[1][0]) / 2, (after[0][1] + after[1][1]) / 2);
  });
  view.addEventListener('wheel', event => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 400), ...spot(event)); }, { passive: false });
  addEventListener('resize', () => { drawView(); drawPlots(); redraw.forEach(draw => draw()); });
  addEventListener('hashchange', fromAddress);
}
function fromAddress() {
  const requested = /layer=(\d+)/.exec(location.hash);
  return requested ? showLayer(+requested[1]) : show(Math.floor(shown.length / 2));
}

fillTexts();
listen();
addPlot('area', 'mm²', layers.set.map(set => set * head.pixel_mm[0] * head.pixel_mm[1]));
addPlot('thickness', 'mm', layers.thickness.map(mm));
addPlot('file', 'bytes', layers.bytes);
if (layers.seconds) addPlot('time, estimated', 's', layers.seconds);
if (layers.sweeps) addPlot('sweeps', '', layers.sweeps);
if (layers.filament) addPlot('filament', 'mm', layers.filament);
if (layers.overhang) addPlot('overhang', 'mm²', layers.overhang);
const ready = fromAddress().then(drawViews).then(() => { document.documentElement.dataset.ready = 'yes'; });
window.laminaReport = { head, state, decodeLayer, showLayer, showLocation, ready };
