// Exit code 0 where a tenth of a picture's pixels are coloured. Usage: node has_colours.mjs PICTURE.png
import { readFileSync } from 'node:fs';
import { decodePng } from './chromium.mjs';

const { channels, pixels } = decodePng(readFileSync(process.argv[2]));
let coloured = 0;
for (let at = 0; at < pixels.length; at += channels) {
  const rgb = pixels.subarray(at, at + 3);
  if (Math.max(...rgb) - Math.min(...rgb) > 30) ++coloured;
}
const share = (coloured * channels) / pixels.length;
console.log(`interop: ${Math.round(100 * share)} % of the picture is coloured`);
process.exitCode = share > 0.1 ? 0 : 1;
