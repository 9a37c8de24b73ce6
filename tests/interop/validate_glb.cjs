// Errors and warnings of Khronos's glTF validator, a line each, of a GLB and the files beside it that it names. Usage:
// node validate_glb.cjs FILE; exit code 1 for any.
const fs = require('fs');
const path = require('path');
const validator = require('gltf-validator');

const bytes = new Uint8Array(fs.readFileSync(process.argv[2]));
const beside = async (uri) => new Uint8Array(fs.readFileSync(path.join(path.dirname(process.argv[2]), decodeURIComponent(uri))));
validator.validateBytes(bytes, { maxIssues: 20, externalResourceFunction: beside }).then(({ issues }) => {
  const kinds = ['error', 'warning'];
  const found = issues.messages.filter(({ severity }) => severity < kinds.length);
  for (const { severity, code, message, pointer } of found) {
    console.log(`${kinds[severity]} ${code}: ${message} (${pointer})`);
  }
  process.exit(found.length > 0 ? 1 : 0);
}, (error) => {
  console.log(String(error));
  process.exit(1);
});
