// Opens a page that is kept compressed inside a small one, which a browser reads from a file as well.
async function unpack(packed) {
  const page = new TextDecoder().decode(await unpacked(packed));
  document.open();
  document.write(page);
  document.close();
}
