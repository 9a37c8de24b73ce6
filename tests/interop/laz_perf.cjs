// A second decoder, laz-perf, of LAZ: its points must be the records of the LAS, byte for byte.
// Usage: node laz_perf.cjs LAZ LAS [LAZ LAS ...]; exit code 1 for a difference, 77 where laz-perf is not installed.
const fs = require('fs');

let createLazPerf;
try {
  ({ createLazPerf } = require('laz-perf'));
} catch {
  console.log('laz-perf is not installed (scripts/setup); skipped');
  process.exit(77);
}

/** The point records of an uncompressed file. */
function records(path) {
  const bytes = fs.readFileSync(path);
  const start = bytes.readUInt32LE(96);
  const size = bytes.readUInt16LE(105);
  const isNew = bytes[25] >= 4;
  const count = isNew ? Number(bytes.readBigUInt64LE(247)) : bytes.readUInt32LE(107);
  return { size, count, bytes: bytes.subarray(start, start + size * count) };
}

/** The same, decoded. */
function decoded(perf, path) {
  const file = fs.readFileSync(path);
  const at = perf._malloc(file.length);
  perf.HEAPU8.set(file, at);
  const decoder = new perf.LASZip();
  decoder.open(at, file.length);
  const size = decoder.getPointLength();
  const count = decoder.getCount();
  const point = perf._malloc(size);
  const bytes = Buffer.alloc(size * count);
  for (let i = 0; i < count; ++i) {
    decoder.getPoint(point);
    bytes.set(perf.HEAPU8.subarray(point, point + size), i * size);
  }
  decoder.delete();
  perf._free(point);
  perf._free(at);
  return { size, count, bytes };
}

createLazPerf().then((perf) => {
  let different = 0;
  const paths = process.argv.slice(2);
  for (let k = 0; k + 1 < paths.length; k += 2) {
    const [laz, las] = [decoded(perf, paths[k]), records(paths[k + 1])];
    const same = laz.size === las.size && laz.count === las.count && laz.bytes.equals(las.bytes);
    console.log(`${paths[k]}: ${laz.count} points of ${laz.size} bytes, ${same ? 'as in' : 'NOT as in'} ${paths[k + 1]}`);
    if (!same) ++different;
  }
  process.exit(different > 0 ? 1 : 0);
});
