"use strict";
// Opens a page that is kept compressed inside a small one: gzip in base64, which a browser reads from a file as well.
async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const page = await new Response(plain).text();
  document.open();
  document.write(page);
  document.close();
}
