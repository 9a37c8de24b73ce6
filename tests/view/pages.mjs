// Opens pages of lamina view in a headless Chromium and looks at what they show: a coloured mesh, a cloud at
// georeferenced coordinates, tile sets in every mode. Whatever a page writes to the console fails it, and so does any request.
// Usage: node pages.mjs LAMINA WORK_FOLDER [PICTURES]
import { execFileSync } from 'node:child_process';
import { mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { Chromium, decodePng } from './chromium.mjs';

const [lamina, folder, pictures] = process.argv.slice(2);
const size = { width: 900, height: 600 };
const faults = [];

function expect(truth, what) {
  if (!truth) faults.push(what);
  console.log(`${truth ? 'ok' : 'NOT OK'}: ${what}`);
}

function run(...options) {
  execFileSync(lamina, [...options, '--quiet'], { stdio: ['ignore', 'ignore', 'inherit'] });
}

/** A ball of red, green and blue thirds with an attribute that grows with z, as an ascii PLY of points with normals. */
function ball(name, count, [x, y, z], comment = '') {
  const lines = [`ply\nformat ascii 1.0\n${comment}element vertex ${count}\n` +
    ['x', 'y', 'z'].map((n) => `property double ${n}\n`).join('') + ['nx', 'ny', 'nz', 'height'].map((n) => `property float ${n}\n`).join('') +
    ['red', 'green', 'blue'].map((n) => `property uchar ${n}\n`).join('') + 'end_header'];
  for (let i = 0; i < count; ++i) {
    const nz = 1 - (2 * i + 1) / count, around = i * Math.PI * (3 - Math.sqrt(5)), flat = Math.sqrt(1 - nz * nz);
    const n = [flat * Math.cos(around), flat * Math.sin(around), nz];
    const colour = [[220, 40, 40], [40, 200, 40], [40, 60, 220]][Math.floor(((nz + 1) / 2.0001) * 3)];
    lines.push([x + n[0], y + n[1], z + n[2], ...n, nz, ...colour].join(' '));
  }
  writeFileSync(join(folder, name), `${lines.join('\n')}\n`);
}

/** The picture right of the panel: which share is no background, and how much of that is red, green, blue. */
function judge(png) {
  const { width, height, channels, pixels } = decodePng(png);
  const count = { model: 0, all: 0, red: 0, green: 0, blue: 0 };
  for (let y = 0; y < height; ++y) {
    for (let x = 300; x < width; ++x) {
      const at = (y * width + x) * channels;
      const [r, g, b] = pixels.subarray(at, at + 3);
      ++count.all;
      if (Math.max(r, g, b) - Math.min(r, g, b) < 24) continue;
      ++count.model;
      if (r > 1.4 * Math.max(g, b)) ++count.red;
      if (g > 1.4 * Math.max(r, b)) ++count.green;
      if (b > 1.4 * Math.max(r, g)) ++count.blue;
    }
  }
  return { share: count.model / count.all, red: count.red / count.model, green: count.green / count.model, blue: count.blue / count.model };
}

const browser = new Chromium(process.env.CHROMIUM ?? 'chromium');

async function look(name, url, act) {
  const page = await browser.open(url, size);
  await page.until("document.documentElement?.dataset.state === 'shown'");
  const see = async (what) => {
    const picture = await page.picture();
    if (pictures) writeFileSync(join(pictures, `${name}_${what}.png`), picture);
    return judge(picture);
  };
  const choose = (label, value) => page.evaluate(`(() => {
    const control = document.getElementById([...document.querySelectorAll('label')].find((l) => l.textContent === ${JSON.stringify(label)}).htmlFor);
    control.value = ${JSON.stringify(value)};
    control.dispatchEvent(new Event('change'));
  })()`);
  await act(page, see, choose);
  expect(page.complaints.length === 0, `${name}: nothing on the console${page.complaints.map((text) => `; ${text}`).join('')}`);
  expect(page.requests.slice(1).every((asked) => /^(blob|data):/.test(asked)), `${name}: asks for nothing`);
  await page.close();
}

const drawn = "/[1-9].* triangles/.test(document.querySelector('.drawn').textContent)";

/** What the button for it would save, decoded. */
async function savedPicture(page, name) {
  const png = Buffer.from(await page.evaluate(`new Promise((done) => {
    const make = URL.createObjectURL;
    URL.createObjectURL = (blob) => {
      const reader = new FileReader();
      reader.onload = () => done(reader.result.split(',')[1]);
      reader.readAsDataURL(blob);
      return make(blob);
    };
    [...document.querySelectorAll('button')].find((button) => button.textContent === 'Picture').click();
  })`), 'base64');
  if (pictures) writeFileSync(join(pictures, `${name}_saved.png`), png);
  return decodePng(png);
}

function count({ width, height, channels, pixels }, wanted) {
  let found = 0;
  for (let at = 0; at < width * height; ++at) {
    if (wanted(pixels.subarray(channels * at, channels * at + 3), at % width, Math.floor(at / width))) ++found;
  }
  return found;
}

const near = (value, wanted, within) => Math.abs(value - wanted) < within;

async function lookAtMesh() {
  ball('ball.ply', 4000, [0, 0, 0]);
  run('surface', join(folder, 'ball.ply'), '-o', join(folder, 'mesh.ply'));
  run('view', join(folder, 'mesh.ply'), '--up', 'z', '-o', join(folder, 'mesh.html'));
  await look('mesh', `file://${join(folder, 'mesh.html')}`, async (page, see, choose) => {
    const colours = await see('colours');
    // A ball that fills the height: pi / 4 of the square of it.
    expect(near(colours.share, 0.66, 0.12), `mesh: fills its part of the picture (${colours.share.toFixed(2)})`);
    expect(Math.min(colours.red, colours.green, colours.blue) > 0.03, `mesh: has all three colours (${JSON.stringify(colours)})`);
    await page.drag([594, 300], [594, 500]);
    const above = await see('orbit');
    expect(above.blue > 0.9 && near(above.share, colours.share, 0.02), `mesh: dragged down it is seen from above, where it is blue (${above.blue.toFixed(2)})`);
    await page.press('f');
    await page.press('o');
    await page.hold('w', 12);
    const nearer = await see('fly');
    expect(nearer.share > 1.15 * colours.share, `mesh: flying brings it nearer (${nearer.share.toFixed(2)})`);
    await page.press('o');
    await page.press('f');
    await page.press('n');
    const normals = await see('normals');
    expect(normals.red > 0.15 && normals.green < 0.1, `mesh: its normals have other colours (${JSON.stringify(normals)})`);
    await choose('Show', '_height');
    const scale = await page.evaluate("document.querySelector('.scale input').value + ' ' + document.querySelectorAll('.scale input')[1].value");
    const [low, high] = scale.split(' ').map(Number);
    expect(near(low, -0.98, 0.05) && near(high, 0.98, 0.05), `mesh: the scale spans the attribute (${scale})`);
    const painted = await see('height');
    expect(painted.red < 0.01 && painted.green > 0.2, `mesh: is painted anew (${JSON.stringify(painted)})`);
    await page.press('m');
    await page.click(594, 220);
    await page.click(594, 380);
    const length = Number(await page.evaluate("document.querySelector('.value.large').textContent"));
    expect(length > 0.3 && length < 1.2, `mesh: a distance on the ball (${length})`);
    await page.press('m');
    await page.press('x');
    const cut = await see('cut');
    expect(cut.share < 0.95 * painted.share, `mesh: the plane cuts something off (${cut.share.toFixed(2)})`);
    await page.press('b');
    await page.press('l');
    await page.press('g');
    await page.press('t');
    await see('edges_flat_light');
  });
}

/** Of eight vertices, whose normals point along the diagonals. */
async function lookAtBox() {
  const lines = ['OFF', '8 12 0'];
  for (let i = 0; i < 8; ++i) lines.push(`${i & 1} ${(i >> 1) & 1} ${i >> 2}`);
  lines.push(...['0 2 3', '0 3 1', '4 5 7', '4 7 6', '0 1 5', '0 5 4', '2 6 7', '2 7 3', '0 4 6', '0 6 2', '1 3 7', '1 7 5'].map((t) => `3 ${t}`));
  writeFileSync(join(folder, 'box.off'), `${lines.join('\n')}\n`);
  run('view', join(folder, 'box.off'), '-o', join(folder, 'box.html'));
  await look('box', `file://${join(folder, 'box.html')}`, async (page, see) => {
    await see('smooth');
    const smooth = await savedPicture(page, 'box');
    await page.press('g');
    await see('flat');
    const flat = await savedPicture(page, 'box_flat');
    const differs = (p, i) => Math.abs(p[0] - flat.pixels[flat.channels * i]) > 8;
    const others = count(smooth, (p, x, y) => differs(p, y * smooth.width + x)) / (smooth.width * smooth.height);
    expect(others < 0.005, `box: its edges are not carried into its faces (${others.toFixed(4)})`);
  });
}

async function lookAtPoints() {
  ball('far.ply', 6000, [500000, 4000000, 100]);
  run('view', join(folder, 'far.ply'), '--points', '3000', '-o', join(folder, 'points.html'));
  await look('points', `file://${join(folder, 'points.html')}`, async (page, see) => {
    const seen = await see('colours');
    expect(seen.share > 0.4 && Math.min(seen.red, seen.green, seen.blue) > 0.03, `points: are seen with their colours (${JSON.stringify(seen)})`);
    const facts = await page.evaluate("document.querySelector('.facts').textContent");
    expect(/3.000 of 6.000 points/.test(facts), `points: the page says that it shows a subset (${facts})`);
    await page.click(594, 300);
    const place = await page.evaluate("document.querySelector('.place').textContent");
    const [x, y, z] = place.match(/-?[\d.]+/g).map(Number);
    expect(near(x, 500000, 1.1) && near(y, 4000000, 1.1) && near(z, 100, 1.1), `points: places are those of the file (${place})`);
    const distance = Math.hypot(x - 500000, y - 4000000, z - 100);
    expect(near(distance, 1, 0.002), `points: to a millimetre or two (${distance})`);
  });
}

async function lookAtTiles() {
  try {
    run('tiles', join(folder, 'mesh.ply'), '-o', join(folder, 'tiles'));
  } catch {
    console.log('no lamina tiles here');
    return;
  }
  run('view', join(folder, 'tiles'), '-o', join(folder, 'tiles.html'));
  await look('tiles', `file://${join(folder, 'tiles.html')}`, async (page, see, choose) => {
    await page.until(drawn);
    const seen = await see('colours');
    expect(near(seen.share, 0.66, 0.12), `tiles: fill their part of the picture (${seen.share.toFixed(2)})`);
    expect(Math.min(seen.red, seen.green, seen.blue) > 0.03, `tiles: have all three colours (${JSON.stringify(seen)})`);
    await choose('Show', '_height');
    const painted = await see('height');
    expect(painted.red < 0.01 && painted.green > 0.2, `tiles: are painted anew (${JSON.stringify(painted)})`);
    await page.press('m');
    await page.click(594, 220);
    await page.click(594, 380);
    const length = Number(await page.evaluate("document.querySelector('.value.large').textContent"));
    expect(length > 0.3 && length < 1.2, `tiles: a distance on the ball (${length})`);
    const saved = await savedPicture(page, 'tiles');
    const orange = count(saved, ([r, g, b]) => r > 230 && Math.abs(g - 176) < 12 && b < 60);
    expect(saved.width === size.width && orange > 300, `tiles: the saved picture has the distance (${orange} pixels)`);
    const ramp = count(saved, ([r, g, b], x, y) => x < 270 && y > 540 && Math.max(r, g, b) - Math.min(r, g, b) > 40);
    expect(ramp > 2000, `tiles: the saved picture has the scale (${ramp} pixels)`);
    await page.press('m');
    await page.press('x');
    const cut = await see('cut');
    expect(cut.share < 0.95 * painted.share, `tiles: the plane cuts something off (${cut.share.toFixed(2)})`);
    await page.press('l');
    await page.press('g');
    await see('edges_flat');
  });
}

/** All leaves side by side have the boundary of the mesh, and no more where they meet. */
async function lookAtBoundary() {
  const file = (name) => join(folder, name);
  run('scatter', '--shape', 'amphora', '--scan', '12', '--count', '60000', '-o', file('amphora.ply'));
  try {
    run('surface', file('amphora.ply'), '-o', file('amphora_mesh.ply'), '--deviation', '0', '--tiles', file('amphora'));
  } catch {
    return;
  }
  run('view', file('amphora_mesh.ply'), '-o', file('amphora_mesh.html'));
  const [, wanted] = readFileSync(file('amphora_mesh.html'), 'latin1').match(/"boundaryEdges":(\d+)/);
  const tileset = JSON.parse(readFileSync(join(folder, 'amphora', 'tileset.json')));
  tileset.root.geometricError = 1e6;  // never good enough: its children are shown
  writeFileSync(join(folder, 'amphora', 'tileset.json'), JSON.stringify(tileset));
  run('view', file('amphora'), '-o', file('amphora.html'));
  await look('boundary', `file://${file('amphora.html')}`, async (page, see) => {
    await page.press('b');
    await page.until(`${drawn} && /boundary/.test(document.querySelector('.drawn').textContent)`);
    await see('loops');
    const text = (await page.evaluate("document.querySelector('.drawn').textContent")).replaceAll('\u202f', '');
    const [, tiles, edges] = text.match(/in (\d+) tiles.* (\d+) boundary edges/) ?? [];
    expect(Number(tiles) > 1 && Number(edges) > 0 && edges === wanted, `boundary: that of the mesh, ${wanted} edges (${text})`);
  });
}

/** On the Earth: an axis of the map points somewhere else there, and a metre of it is a little longer. */
async function lookAtEarth() {
  ball('utm.ply', 4000, [500000, 4000000, 100], 'comment crs EPSG:32633\n');
  try {
    run('surface', join(folder, 'utm.ply'), '-o', join(folder, 'utm_mesh.ply'), '--tiles', join(folder, 'utm'));
  } catch {
    return;
  }
  run('view', join(folder, 'utm'), '-o', join(folder, 'utm.html'));
  await look('earth', `file://${join(folder, 'utm.html')}`, async (page, see) => {
    await page.until("/[1-9].* triangles/.test(document.querySelector('.drawn').textContent)");
    const seen = await see('colours');
    expect(near(seen.share, 0.66, 0.12), `earth: the tiles fill their part of the picture (${seen.share.toFixed(2)})`);
    await page.click(594, 300);
    const place = await page.evaluate("document.querySelector('.place').textContent");
    const [x, y, z] = (place.match(/-?[\d.]+/g) ?? [0, 0, 0]).map(Number);
    const distance = Math.hypot(x - 500000, y - 4000000, z - 100);
    expect(near(distance, 1, 0.01), `earth: places are those of the map (${place}: ${distance})`);
  });
}

rmSync(folder, { recursive: true, force: true });
mkdirSync(folder, { recursive: true });
try {
  await lookAtMesh();
  await lookAtBox();
  await lookAtPoints();
  await lookAtTiles();
  await lookAtBoundary();
  await lookAtEarth();
} finally {
  await browser.close();
}
process.exitCode = faults.length > 0 ? 1 : 0;
