// The program: one sub-command per tool.
#include <fmt/format.h>

#include "lamina/error.h"
#include "tool.h"

int main(int argc, char** argv) {
  CLI::App app{"Lamina: streaming surface reconstruction from oriented points", "lamina"};
  lamina::tools::add_scatter(app);
  lamina::tools::add_compare(app);
  lamina::tools::add_check(app);
  app.require_subcommand(1);
  try {
    app.parse(argc, argv);
    return static_cast<int>(lamina::ExitCode::ok);
  } catch (const CLI::ParseError& e) {
    const int code = app.exit(e);
    return code == 0 ? 0 : static_cast<int>(lamina::ExitCode::usage);
  } catch (const lamina::Error& e) {
    fmt::print(stderr, "lamina: {}\n", e.what());
    return static_cast<int>(e.code());
  } catch (const std::exception& e) {
    fmt::print(stderr, "lamina: internal error: {}\n", e.what());
    return static_cast<int>(lamina::ExitCode::internal);
  }
}
