// What is large is held as gzip: in base64 by pages, in letters of 15 bits by scripts of their own.
async function unzipped(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
const bytes_of_base64 = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
function bytes_of_letters(text) {
  const value = (k) => text.charCodeAt(k) - 0x4e00;
  const bytes = new Uint8Array(Math.floor((15 * (text.length - 1)) / 8) - value(0));
  for (let k = 1, at = 0, held = 0, bits = 0; k < text.length; k++) {
    held = (held << 15) | value(k);
    for (bits += 15; bits >= 8 && at < bytes.length; held &= (1 << bits) - 1) bytes[at++] = held >> (bits -= 8);
  }
  return bytes;
}
