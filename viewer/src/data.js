// What the page holds: blocks of base64 in script elements, deflated.

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

function elementsOf(name) {
  return document.querySelectorAll(`script[data-block="${CSS.escape(name)}"]`);
}

/** The bytes of a block, or nothing where the page has none. Its text leaves memory as it is read. */
export async function readBlock(name, { keep = false } = {}) {
  const elements = [...elementsOf(name)];
  if (elements.length === 0) return null;
  const unpack = new DecompressionStream('gzip');
  const bytes = new Response(unpack.readable).arrayBuffer();
  const writer = unpack.writable.getWriter();
  for (const element of elements) {
    const piece = fromBase64(element.textContent);
    if (!keep) element.remove();
    await writer.write(piece);
  }
  await writer.close();
  return bytes;
}

/** The names of the files of a tile set in the page. */
export function blockNames(prefix) {
  const names = new Set();
  for (const element of document.querySelectorAll('script[data-block]')) {
    const name = element.dataset.block;
    if (name.startsWith(prefix)) names.add(name.slice(prefix.length));
  }
  return names;
}
