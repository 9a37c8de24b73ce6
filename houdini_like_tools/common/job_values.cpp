#include "common/job.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <map>
#include <string_view>
#include <utility>

#include "common/help.h"
#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {
namespace {

using Texts = std::vector<std::string>;

/// An option as a job file sees it.
struct JobKey {
  CLI::Option* option = nullptr;
  Texts names;  ///< the first is the one that is printed
  OptionEntry entry;
};

std::string in_small_letters(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// What the tool can be told, in the order of its help. `option_table` lists the same options in the same order.
std::vector<JobKey> keys_of(CLI::App& tool) {
  static constexpr std::array<std::string_view, 2> kNotOfTheRun{"help", "print-job"};
  std::vector<JobKey> keys;
  const std::vector<OptionEntry> table = option_table(tool);
  std::size_t row = 0;
  for (CLI::Option* option : tool.get_options()) {
    if (option->get_group().empty()) continue;
    JobKey key;
    key.option = option;
    key.entry = table.at(row++);
    for (const std::string& name : option->get_lnames()) key.names.push_back(name);
    if (key.entry.positional) key.names = {in_small_letters(key.entry.names.front()), key.entry.names.front()};
    for (const std::string& name : option->get_snames()) key.names.push_back(name);
    const bool run = std::find(kNotOfTheRun.begin(), kNotOfTheRun.end(), key.names.front()) == kNotOfTheRun.end();
    if (run) keys.push_back(std::move(key));
  }
  return keys;
}

bool names_file(const JobKey& key) {
  const std::string& value = key.entry.value;
  return key.entry.positional || value.starts_with("FILE") || value.starts_with("DIR") || value.starts_with("OUT");
}

/// A flag that can be switched off by another name, as --keep-strays does with --strays.
bool has_opposite(const JobKey& key) {
  return !key.option->get_fnames().empty();
}

/// Words that stand for numbers in the program have become these when the parser is done.
std::string as_typed(const JobKey& key, const std::string& result) {
  const Texts& words = key.entry.choices;
  if (words.empty() || std::find(words.begin(), words.end(), result) != words.end()) return result;
  for (const std::string& word : words) {
    std::string taken = word;
    try {
      (*key.option->get_validator())(taken);
    } catch (const CLI::OptionNotFound&) {
      return result;  // nothing that would change a word
    }
    if (taken == result) return word;
  }
  return result;
}

/// A number where printing it gives the text again, so that nothing is lost.
Json number_or_text(const std::string& text) {
  if (Json number = Json::parse(text, nullptr, false); number.is_number() && number.dump() == text) return number;
  return text;
}

std::string text_of_number(const Json& number) {
  constexpr double kWhole = 9007199254740992.0;  // 2^53: whole numbers above are not all doubles
  if (number.is_number_float()) {
    const double value = number.get<double>();
    if (value == std::floor(value) && std::abs(value) < kWhole) return fmt::format("{:.0f}", value);
  }
  return number.dump();
}

[[noreturn]] void refuse(const std::string& key, const std::string& why) {
  throw Error(ExitCode::usage, fmt::format("key '{}' {}", key, why));
}

/// For the message: what the key takes.
std::string kind_of(const JobKey& key) {
  if (!key.entry.takes_value) return "true or false";
  const std::string one = names_file(key) ? "a name in quotes" : key.entry.value.empty() ? "a value" : key.entry.value;
  return key.entry.repeatable ? fmt::format("a list of {}", one) : one;
}

std::string single_text(const JobKey& key, const std::string& name, const Json& value) {
  const bool number = value.is_number() && !names_file(key);
  if (!number && !value.is_string()) refuse(name, fmt::format("takes {}, not {}", kind_of(key), value.dump()));
  std::string text = number ? text_of_number(value) : value.get<std::string>();
  if (text.find('\0') != std::string::npos) refuse(name, "holds a zero byte");
  return text;
}

bool are_numbers(const Json& list) {
  return std::all_of(list.begin(), list.end(), [](const Json& value) { return value.is_number(); });
}

/// What would be typed, once for each value.
Texts texts_of(const JobKey& key, const std::string& name, const Json& value) {
  if (!value.is_array()) return {single_text(key, name, value)};
  if (value.empty()) refuse(name, "is an empty list; leave it out");
  const auto joined = [&](const Json& list) {
    Texts parts;
    for (const Json& part : list) parts.push_back(single_text(key, name, part));
    return fmt::format("{}", fmt::join(parts, ","));
  };
  const bool commas = key.entry.value.find(',') != std::string::npos;
  if (!key.entry.repeatable) {
    if (!commas) refuse(name, fmt::format("takes one value ({}), not a list", kind_of(key)));
    return {joined(value)};
  }
  if (commas && are_numbers(value)) return {joined(value)};  // one place, say
  Texts texts;
  for (const Json& one : value) texts.push_back(commas && one.is_array() ? joined(one) : single_text(key, name, one));
  return texts;
}

void take_flag(const JobKey& key, const std::string& name, const Json& value) {
  if (!value.is_boolean()) refuse(name, fmt::format("takes true or false, not {}", value.dump()));
  const bool on = value.get<bool>();
  if (on || has_opposite(key)) key.option->add_result(key.option->get_flag_value(name, on ? "true" : "false"));
}

void take_value(const JobKey& key, const std::string& name, const Json& value) {
  if (key.entry.takes_value) {
    for (std::string& text : texts_of(key, name, value)) key.option->add_result(std::move(text));
  } else {
    take_flag(key, name, value);
  }
  if (key.option->count() == 0) return;
  try {
    key.option->run_callback();
  } catch (const CLI::ParseError& e) {
    const bool kind = !key.entry.choices.empty() || dynamic_cast<const CLI::ConversionError*>(&e) != nullptr;
    if (kind) refuse(name, fmt::format("cannot be {}; it takes {}", value.dump(), kind_of(key)));
    std::string why = e.what();
    const std::size_t colon = why.find(": ");
    if (why.starts_with('-') && colon != std::string::npos) why.erase(0, colon + 2);
    throw Error(ExitCode::usage, fmt::format("key '{}': {}", name, why));
  }
}

std::string nearest_key(const std::string& name, const std::vector<JobKey>& keys) {
  Texts names;
  for (const JobKey& key : keys) names.insert(names.end(), key.names.begin(), key.names.end());
  return nearest_word(name.substr(std::min(name.find_first_not_of('-'), name.size())), names);
}

/// The values by the options they are for: (name, value).
std::map<const CLI::Option*, std::pair<std::string, Json>> sort_out(const std::vector<JobKey>& keys,
                                                                    const Json& values) {
  std::map<const CLI::Option*, std::pair<std::string, Json>> sorted;
  for (const auto& [name, value] : values.items()) {
    const auto key = std::find_if(keys.begin(), keys.end(), [&name = name](const JobKey& k) {
      return std::find(k.names.begin(), k.names.end(), name) != k.names.end();
    });
    if (key == keys.end()) {
      const std::string near = nearest_key(name, keys);
      throw Error(ExitCode::usage, fmt::format("there is no key '{}'{}", name,
                                               near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
    }
    const auto [before, fresh] = sorted.try_emplace(key->option, name, value);
    if (!fresh) refuse(name, fmt::format("says the same as '{}'; leave one out", before->second.first));
  }
  return sorted;
}

}  // namespace

Json values_of(CLI::App& tool) {
  Json values = Json::object();
  for (const JobKey& key : keys_of(tool)) {
    if (key.option->count() == 0) continue;
    const std::string& name = key.names.front();
    const Texts& results = key.option->results();
    if (!key.entry.takes_value) {
      const bool on = CLI::detail::to_flag_value(results.back()) > 0;
      if (on || has_opposite(key)) values[name] = on;
      continue;
    }
    Json list = Json::array();
    for (const std::string& result : results) {
      const std::string text = as_typed(key, result);
      list.push_back(names_file(key) ? Json(text) : number_or_text(text));
    }
    values[name] = key.entry.repeatable ? list : list.back();
  }
  return values;
}

void take_values(CLI::App& tool, const Json& values) {
  const std::vector<JobKey> keys = keys_of(tool);
  const auto sorted = sort_out(keys, values);
  for (const JobKey& key : keys) {
    const auto given = sorted.find(key.option);
    if (given != sorted.end()) {
      take_value(key, given->second.first, given->second.second);
    } else if (key.entry.required) {
      refuse(key.names.front(), "is missing");
    }
  }
}

std::vector<NamedFile> files_of(CLI::App& tool, const Json& values) {
  const std::vector<JobKey> keys = keys_of(tool);
  std::vector<NamedFile> files;
  for (const auto& [option, given] : sort_out(keys, values)) {
    const auto key = std::find_if(keys.begin(), keys.end(), [o = option](const JobKey& k) { return k.option == o; });
    if (!key->entry.takes_value || !names_file(*key)) continue;
    for (std::string& text : texts_of(*key, given.first, given.second))
      files.push_back({given.first, std::move(text), key->entry.positional});
  }
  return files;
}

std::string about_keys(const std::string& message) {
  std::string text;
  for (std::size_t at = 0; at < message.size();) {
    const bool option = (at == 0 || message[at - 1] == ' ') && message.compare(at, 2, "--") == 0;
    const std::size_t end = std::min(message.find_first_of(" :,;", at), message.size());
    text += option ? "'" + message.substr(at + 2, end - at - 2) + "'"
                   : message.substr(at, std::max<std::size_t>(end - at, 1));
    at = std::max(end, at + 1);
  }
  return text;
}

}  // namespace lamina::tools
