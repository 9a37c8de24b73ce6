// A picture of a page of lamina view, as a browser shows it. Usage: node picture.mjs PAGE.html OUT.png [KEYS]
// KEYS are pressed first, as in "xb": clipping plane, boundary loops.
import { writeFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { Chromium } from './chromium.mjs';

const [page, out, keys = ''] = process.argv.slice(2);
const browser = new Chromium(process.env.CHROMIUM ?? 'chromium');
try {
  const shown = await browser.open(`file://${resolve(page)}`, { width: 1120, height: 700 });
  await shown.until("document.documentElement?.dataset.state === 'shown'");
  for (const key of keys) await shown.press(key);
  writeFileSync(out, await shown.picture());
} finally {
  await browser.close();
}
