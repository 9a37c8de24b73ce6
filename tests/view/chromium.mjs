// Drives a headless Chromium over a pipe: opens pages, clicks, evaluates, and takes pictures of them.
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { inflateSync } from 'node:zlib';

const flags = [
  '--headless=new', '--no-sandbox', '--disable-gpu-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader', '--no-first-run', '--disable-extensions', '--disable-background-networking',
  '--disable-component-update', '--mute-audio', '--hide-scrollbars', '--remote-debugging-pipe', '--force-device-scale-factor=1',
];

export class Chromium {
  constructor(program) {
    this.folder = mkdtempSync(join(tmpdir(), 'lamina-chromium-'));
    this.child = spawn(program, [...flags, `--user-data-dir=${this.folder}`, 'about:blank'], {
      stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'],
      detached: true,  // a process group of its own, which ends as a whole
    });
    this.asked = new Map();
    this.listeners = [];
    this.number = 0;
    let held = Buffer.alloc(0);
    this.child.stdio[4].on('data', (bytes) => {
      held = Buffer.concat([held, bytes]);
      for (let end = held.indexOf(0); end >= 0; end = held.indexOf(0)) {
        this.receive(JSON.parse(held.subarray(0, end).toString()));
        held = held.subarray(end + 1);
      }
    });
    this.child.stdio[3].on('error', () => {});
    this.child.on('exit', () => {
      for (const { reject } of this.asked.values()) reject(new Error('Chromium has ended'));
    });
  }

  receive(message) {
    if (!message.id) return this.listeners.forEach((listener) => listener(message));
    const { resolve, reject } = this.asked.get(message.id);
    this.asked.delete(message.id);
    if (message.error) reject(new Error(message.error.message));
    else resolve(message.result);
  }

  send(method, params = {}, sessionId = undefined) {
    const id = ++this.number;
    this.child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    return new Promise((resolve, reject) => this.asked.set(id, { resolve, reject }));
  }

  async open(url, { width = 1280, height = 800 } = {}) {
    const { targetId } = await this.send('Target.createTarget', { url: 'about:blank' });
    const { sessionId } = await this.send('Target.attachToTarget', { targetId, flatten: true });
    const page = new Page(this, sessionId, targetId);
    await page.send('Runtime.enable');
    await page.send('Log.enable');
    await page.send('Network.enable');
    await page.send('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: 1, mobile: false });
    await page.send('Page.navigate', { url });
    return page;
  }

  async close() {
    const ended = new Promise((resolve) => this.child.on('exit', resolve));
    process.kill(-this.child.pid, 'SIGKILL');
    await ended;
    // Its helpers end a little later than itself, and may still write.
    for (let tries = 0; ; ++tries) {
      try {
        return rmSync(this.folder, { recursive: true, force: true });
      } catch (error) {
        if (tries === 100) throw error;
        await pause(100);
      }
    }
  }
}

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

export class Page {
  constructor(browser, sessionId, targetId) {
    Object.assign(this, { browser, sessionId, targetId, complaints: [], requests: [] });
    browser.listeners.push((message) => this.hear(message));
  }

  hear({ sessionId, method, params }) {
    if (sessionId !== this.sessionId) return;
    if (method === 'Runtime.exceptionThrown') this.complaints.push(params.exceptionDetails.exception?.description ?? 'exception');
    if (method === 'Runtime.consoleAPICalled' && ['error', 'assert'].includes(params.type)) {
      const text = params.args.map((argument) => argument.value ?? argument.description).join(' ');
      this.complaints.push(text);
    }
    if (method === 'Log.entryAdded' && params.entry.level === 'error') this.complaints.push(params.entry.text);
    if (method === 'Network.requestWillBeSent') this.requests.push(params.request.url);
  }

  send(method, params) {
    return this.browser.send(method, params, this.sessionId);
  }

  async evaluate(expression) {
    const { result, exceptionDetails } = await this.send('Runtime.evaluate', { expression, returnByValue: true, awaitPromise: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  /** Until the expression is true, at most a minute: a busy machine without a graphics card draws slowly. */
  async until(expression) {
    for (let tries = 0; tries < 300; ++tries) {
      if (await this.evaluate(expression)) return;
      if (this.complaints.length > 0) break;
      await pause(200);
    }
    throw new Error(`never came true: ${expression}; the page complains: ${this.complaints.join('; ') || 'nothing'}`);
  }

  /** After two more frames. */
  async settle() {
    await this.evaluate('new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))');
  }

  async click(x, y, count = 1) {
    for (const type of ['mouseMoved', 'mousePressed', 'mouseReleased']) {
      await this.send('Input.dispatchMouseEvent', { type, x, y, button: 'left', clickCount: count });
    }
    await this.settle();
  }

  async press(key) {
    for (const type of ['keyDown', 'keyUp']) await this.send('Input.dispatchKeyEvent', { type, key, code: `Key${key.toUpperCase()}`, text: key });
    await this.settle();
  }

  /** Holds a letter's key down until so many frames are drawn. */
  async hold(key, frames) {
    const event = { key, code: `Key${key.toUpperCase()}` };
    await this.send('Input.dispatchKeyEvent', { type: 'keyDown', text: key, ...event });
    for (let i = 0; i < frames; ++i) await this.settle();
    await this.send('Input.dispatchKeyEvent', { type: 'keyUp', ...event });
  }

  async drag([x, y], [toX, toY]) {
    const mouse = (type, atX, atY) => this.send('Input.dispatchMouseEvent', { type, x: atX, y: atY, button: 'left', buttons: 1, clickCount: 1 });
    await mouse('mousePressed', x, y);
    for (let i = 1; i <= 4; ++i) await mouse('mouseMoved', x + (toX - x) * i / 4, y + (toY - y) * i / 4);
    await mouse('mouseReleased', toX, toY);
    await this.settle();
  }

  async picture() {
    await this.settle();
    const { data } = await this.send('Page.captureScreenshot', { format: 'png' });
    return Buffer.from(data, 'base64');
  }

  async close() {
    await this.browser.send('Target.closeTarget', { targetId: this.targetId });
  }
}

/** The pixels of a PNG of 8-bit RGB or RGBA. */
export function decodePng(png) {
  const width = png.readUInt32BE(16), height = png.readUInt32BE(20);
  const channels = png[25] === 6 ? 4 : 3;
  const packed = [];
  for (let at = 8; at < png.length;) {
    const length = png.readUInt32BE(at);
    if (png.toString('latin1', at + 4, at + 8) === 'IDAT') packed.push(png.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  const rows = inflateSync(Buffer.concat(packed));
  const stride = width * channels;
  const pixels = Buffer.alloc(height * stride);
  for (let y = 0; y < height; ++y) {
    const filter = rows[y * (stride + 1)];
    for (let i = 0; i < stride; ++i) {
      const left = i >= channels ? pixels[y * stride + i - channels] : 0;
      const above = y > 0 ? pixels[(y - 1) * stride + i] : 0;
      const corner = i >= channels && y > 0 ? pixels[(y - 1) * stride + i - channels] : 0;
      const guess = [0, left, above, (left + above) >> 1, paeth(left, above, corner)][filter];
      pixels[y * stride + i] = (rows[y * (stride + 1) + 1 + i] + guess) & 255;
    }
  }
  return { width, height, channels, pixels };
}

function paeth(left, above, corner) {
  const guess = left + above - corner;
  const [a, b, c] = [left, above, corner].map((value) => Math.abs(guess - value));
  return a <= b && a <= c ? left : b <= c ? above : corner;
}
