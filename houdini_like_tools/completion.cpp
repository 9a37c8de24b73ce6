// lamina completion: what bash needs to complete the program's command lines.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <string>

#include "common/help.h"
#include "tool.h"

namespace lamina::tools {
namespace {

/// The words a position can hold: options of a tool, or values of one of its options.
std::string bash_script(const CLI::App& app) {
  std::string tools, options, values;
  for (const CLI::App* tool : shown_tools(app)) {
    tools += (tools.empty() ? "" : " ") + tool->get_name();
    std::vector<std::string> names;
    for (const OptionEntry& entry : option_table(*tool)) {
      if (entry.positional) continue;
      for (const std::string& name : entry.names) {
        names.push_back(name);
        if (name == "--tmp-dir") {
          values +=
              fmt::format("    {}:{}) COMPREPLY=($(compgen -d -- \"$word\")); return ;;\n", tool->get_name(), name);
        } else if (!entry.choices.empty()) {
          values += fmt::format("    {}:{}) COMPREPLY=($(compgen -W '{}' -- \"$word\")); return ;;\n", tool->get_name(),
                                name, fmt::join(entry.choices, " "));
        }
      }
    }
    options += fmt::format("    {}) options='{}' ;;\n", tool->get_name(), fmt::join(names, " "));
  }
  // File names come from bash itself wherever the function has nothing to say.
  return fmt::format(R"(# Completion of lamina's command lines for bash, made by `lamina completion bash`.
_lamina() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} tool=${{COMP_WORDS[1]}} options=
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    COMPREPLY=($(compgen -W '{} --help --version' -- "$word"))
    return
  fi
  case $tool:$before in
{}  esac
  case $tool in
{}  esac
  if [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$word"))
  fi
}}
complete -o bashdefault -o default -F _lamina lamina
)",
                     tools, values, options);
}

}  // namespace

void add_completion(CLI::App& app) {
  auto* tool = app.add_subcommand("completion", "Print a shell's completion script")->group("");
  auto shell = std::make_shared<std::string>();
  tool->add_option("SHELL", *shell, "bash")->required()->check(CLI::IsMember({"bash"}).description(""));
  tool->callback([&app, shell] { fmt::print("{}", bash_script(app)); });
}

}  // namespace lamina::tools
