// lamina man: manual pages and the reference, made from the tools' own options.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "common/help.h"
#include "common/outputs.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "tool.h"

namespace lamina::tools {
namespace {

/// Text as roff shows it literally.
std::string literal(std::string_view text) {
  std::string out;
  bool line_start = true;
  for (const char c : text) {
    if (line_start && (c == '.' || c == '\'')) out += "\\&";
    line_start = c == '\n';
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

std::string title(const std::string& page) {
  return fmt::format(".TH {} 1 \"\" \"lamina {}\" \"Lamina\"\n", page, version());
}

std::string synopsis(const CLI::App& tool) {
  std::string text = fmt::format(".SH SYNOPSIS\n.B lamina {}\n", tool.get_name());
  for (const OptionEntry& entry : option_table(tool)) {
    if (!entry.positional) continue;
    const std::string name = literal(entry.names.front());
    text += entry.required ? fmt::format(".I {}\n", name) : fmt::format("[\\fI{}\\fR]\n", name);
  }
  for (const OptionEntry& entry : option_table(tool)) {
    if (!entry.positional && entry.required)
      text += fmt::format("\\fB{}\\fR \\fI{}\\fR\n", literal(entry.names.back()), literal(entry.value));
  }
  return text + "[\\fIOPTIONS\\fR]\n";
}

std::string entry_text(const OptionEntry& entry) {
  std::string names;
  for (const std::string& name : entry.names) {
    names += (names.empty() ? "" : ", ") + fmt::format("\\fB{}\\fR", literal(name));
  }
  if (!entry.value.empty()) names += fmt::format(" \\fI{}\\fR", literal(entry.value));
  std::string text = fmt::format(".TP\n{}\n{}", names, literal(entry.description));
  if (!entry.range.empty()) text += literal(fmt::format(" ({})", entry.range));
  if (!entry.fallback.empty()) text += literal(fmt::format(" [{}]", entry.fallback));
  return text + ".\n";
}

std::string description(const CLI::App& tool) {
  std::string text;
  for (const std::string& note : notes_of(tool))
    text += fmt::format("{}\n{}\n", text.empty() ? ".SH DESCRIPTION" : ".PP", literal(note));
  return text;
}

std::string options(const CLI::App& tool) {
  const std::vector<OptionEntry> table = option_table(tool);
  std::string text = ".SH OPTIONS\n";
  for (const std::string& group : groups_of(table)) {
    text += fmt::format(".SS {}\n", literal(group));
    for (const OptionEntry& entry : table)
      if (entry.group == group) text += entry_text(entry);
  }
  return text;
}

std::string examples(const CLI::App& tool) {
  std::string text;
  for (const std::string& line : examples_of(tool)) text += literal(line) + "\n";
  return text.empty() ? "" : ".SH EXAMPLES\n.nf\n" + text + ".fi\n";
}

std::string exit_status() {
  const auto& meanings = exit_code_meanings();
  std::string text = ".SH EXIT STATUS\n";
  for (std::size_t code = 0; code < meanings.size(); ++code)
    text += fmt::format(".TP\n.B {}\n{}.\n", code, literal(meanings.at(code)));
  return text;
}

std::string tool_page(const CLI::App& tool) {
  const std::string page = "lamina-" + tool.get_name();
  return title(page) + fmt::format(".SH NAME\n{} \\- {}\n", literal(page), literal(tool.get_description())) +
         synopsis(tool) + description(tool) + options(tool) + examples(tool) + exit_status() +
         ".SH SEE ALSO\n.BR lamina (1)\n";
}

std::string main_page(const CLI::App& app) {
  std::string text = title("lamina") + ".SH NAME\nlamina \\- streaming surface reconstruction from oriented points\n" +
                     ".SH SYNOPSIS\n.B lamina\n.I TOOL\n[\\fIARGUMENTS\\fR]\n.SH TOOLS\n";
  std::string pages;
  for (const CLI::App* tool : shown_tools(app)) {
    text += fmt::format(".TP\n.B {}\n{}.\n", literal(tool->get_name()), literal(tool->get_description()));
    pages += fmt::format("{}.BR lamina\\-{} (1)", pages.empty() ? "" : ",\n", literal(tool->get_name()));
  }
  return text + exit_status() + ".SH SEE ALSO\n" + pages + "\n";
}

struct ManOptions {
  std::string tool, folder;
  bool reference = false;
};

void run_man(const CLI::App& app, const ManOptions& o) {
  if (o.reference) {
    fmt::print("{}", reference_page(app));
    return;
  }
  if (!o.folder.empty()) {
    const std::filesystem::path folder = o.folder;
    ResultFile((folder / "lamina.1").string()).write(main_page(app));
    for (const CLI::App* tool : shown_tools(app))
      ResultFile((folder / ("lamina-" + tool->get_name() + ".1")).string()).write(tool_page(*tool));
    return;
  }
  if (o.tool.empty()) {
    fmt::print("{}", main_page(app));
    return;
  }
  for (const CLI::App* tool : shown_tools(app)) {
    if (tool->get_name() != o.tool) continue;
    fmt::print("{}", tool_page(*tool));
    return;
  }
  throw Error(ExitCode::usage, fmt::format("man: there is no tool '{}'", o.tool));
}

}  // namespace

void add_man(CLI::App& app) {
  auto* tool = app.add_subcommand("man", "Print a manual page, for man -l -")->group("");
  auto o = std::make_shared<ManOptions>();
  tool->add_option("TOOL", o->tool, "The tool's page; without it the program's");
  tool->add_option("--all", o->folder, "Write all pages into this folder instead")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  tool->add_flag("--reference", o->reference, "Print docs/reference.md instead: all options of all tools");
  tool->callback([&app, o] { run_man(app, *o); });
}

}  // namespace lamina::tools
