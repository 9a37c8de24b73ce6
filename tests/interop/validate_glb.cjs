// Errors and warnings of Khronos's glTF validator, a line each. Usage: node validate_glb.cjs FILE; exit code 1 for any.
const fs = require('fs');
const validator = require('gltf-validator');

const bytes = new Uint8Array(fs.readFileSync(process.argv[2]));
const options = { maxIssues: 20, externalResourceFunction: () => Promise.reject(new Error('names another file')) };
validator.validateBytes(bytes, options).then(({ issues }) => {
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
