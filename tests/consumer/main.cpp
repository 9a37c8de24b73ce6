// Uses the installed headers and library: a length read from text, and the version the package was built as.
#include <cstdio>

#include "lamina/length.h"
#include "lamina/run.h"

int main() {
  const lamina::Length length = lamina::parse_length("0.5R");
  const double world = lamina::resolve(length, 2.0, 3.0);
  std::printf("lamina %s: 0.5R = %g\n", lamina::version().data(), world);
  return world == 3.0 ? 0 : 1;
}
