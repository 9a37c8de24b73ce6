#include "e57/e57.h"

#include <expat.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <memory>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include "base/descriptor.h"
#include "base/number.h"

namespace lamina::e57 {
namespace {

constexpr std::size_t kDeepest = 64;
constexpr std::size_t kLongestText = 1 << 20;
constexpr std::string_view kScanPath = "e57Root/data3D/vectorChild";

/// The path behind `front`, if it begins with it.
std::optional<std::string_view> path_below(std::string_view path, std::string_view front) {
  if (!path.starts_with(front) || path.size() <= front.size() || path[front.size()] != '/') return std::nullopt;
  return path.substr(front.size() + 1);
}

/// One element's attributes, as the parser hands them over: names and values in turn.
class XmlAttributes {
 public:
  explicit XmlAttributes(const XML_Char** list) : list_(list) {}
  [[nodiscard]] std::optional<std::string_view> get(std::string_view name) const {
    for (const XML_Char** at = list_; *at != nullptr; at += 2) {
      if (name == *at) return std::string_view(at[1]);
    }
    return std::nullopt;
  }

 private:
  const XML_Char** list_;
};

/// Takes the elements as they come and keeps what is about points. The parser is written in C, so nothing may be thrown
/// through it: what is wrong is kept as a text.
class ContentsBuilder {
 public:
  explicit ContentsBuilder(Contents& contents) : contents_(contents) {}
  [[nodiscard]] const std::string& wrong() const { return wrong_; }

  void begin(std::string_view name, const XmlAttributes& attributes) {
    lengths_.push_back(path_.size());
    if (lengths_.size() > kDeepest) return fail(fmt::format("elements lie more than {} deep", kDeepest));
    path_ += (path_.empty() ? "" : "/") + std::string(name);
    text_.clear();
    const std::string_view type = attributes.get("type").value_or("");
    value_scale_ = type == "ScaledInteger" ? number(attributes, "scale", 1) : 1;
    value_offset_ = type == "ScaledInteger" ? number(attributes, "offset", 0) : 0;
    if (path_ == kScanPath) contents_.scans.emplace_back();
    if (path_ == "e57Root/images2D/vectorChild") ++contents_.images;
    const auto part = path_below(path_, kScanPath);
    if (!part) return;
    Scan& scan = contents_.scans.back();
    if (*part == "pose") scan.has_pose = true;
    if (*part == "pose/rotation") scan.has_rotation = true;
    if (*part == "points") {
      scan.section = payload_offset(whole<std::uint64_t>(attributes, "fileOffset", 0));
      scan.records = whole<std::uint64_t>(attributes, "recordCount", 0);
    }
    if (part->starts_with("points/prototype/") && type != "Structure" && type != "Vector") {
      add_field(scan, std::string(name), type, attributes);
    }
  }

  void text(std::string_view more) {
    if (text_.size() + more.size() <= kLongestText) text_ += more;
  }

  void end() {
    const std::string_view value = trimmed(text_);
    if (path_ == "e57Root/coordinateMetadata") contents_.coordinate_metadata = value;
    if (const auto part = path_below(path_, kScanPath)) take_value(contents_.scans.back(), *part, value);
    text_.clear();
    path_.resize(lengths_.back());
    lengths_.pop_back();
  }

 private:
  void fail(std::string what) {
    if (wrong_.empty()) wrong_ = std::move(what);
  }

  template <class T>
  T whole(const XmlAttributes& attributes, std::string_view name, T otherwise) {
    const auto word = attributes.get(name);
    if (!word) return otherwise;
    const std::string_view digits = trimmed(*word);
    T value{};
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc{} && end == digits.data() + digits.size()) return value;
    fail(fmt::format("{} of {} is no whole number of 64 bits", name, path_));
    return otherwise;
  }

  double number(const XmlAttributes& attributes, std::string_view name, double otherwise) {
    const auto word = attributes.get(name);
    double value = otherwise;
    if (word && (!is_number(trimmed(*word), value) || !std::isfinite(value))) {
      fail(fmt::format("{} of {} is no number", name, path_));
    }
    return value;
  }

  void add_field(Scan& scan, std::string name, std::string_view type, const XmlAttributes& attributes) {
    Field field{std::move(name)};
    if (type == "Integer" || type == "ScaledInteger") {
      field.kind = type == "Integer" ? Field::Kind::integer : Field::Kind::scaled_integer;
      field.minimum = whole(attributes, "minimum", field.minimum);
      field.maximum = whole(attributes, "maximum", field.maximum);
      field.scale = value_scale_;
      field.offset = value_offset_;
      if (field.maximum < field.minimum) fail(fmt::format("the maximum of {} is below its minimum", path_));
    } else if (type == "Float") {
      const std::string_view precision = attributes.get("precision").value_or("double");
      if (precision != "double" && precision != "single") fail(fmt::format("the precision of {} is unknown", path_));
      field.kind = precision == "single" ? Field::Kind::single_float : Field::Kind::double_float;
    } else if (type == "String") {
      field.kind = Field::Kind::text;
    } else {
      fail(fmt::format("the type of {} is unknown", path_));
    }
    scan.fields.push_back(std::move(field));
  }

  void take_value(Scan& scan, std::string_view part, std::string_view text) {
    double* target = nullptr;
    constexpr std::string_view kQuaternion = "wxyz";
    const auto rotation = path_below(part, "pose/rotation");
    const auto translation = path_below(part, "pose/translation");
    const auto intensity = path_below(part, "intensityLimits");
    const auto colour = path_below(part, "colorLimits");
    if (rotation && rotation->size() == 1 && kQuaternion.find(rotation->front()) != kQuaternion.npos) {
      target = &scan.rotation[kQuaternion.find(rotation->front())];
    } else if (translation && translation->size() == 1 &&
               kQuaternion.find(translation->front(), 1) != kQuaternion.npos) {
      target = &scan.translation[kQuaternion.find(translation->front(), 1) - 1];
    } else if (intensity) {
      target = limit(scan.intensity, *intensity, "intensity");
    } else if (colour) {
      for (std::size_t k = 0; k < 3 && target == nullptr; ++k) {
        constexpr std::array<std::string_view, 3> kNames{"colorRed", "colorGreen", "colorBlue"};
        target = limit(scan.colour[k], *colour, kNames[k]);
      }
    }
    if (target == nullptr) return;
    double value = 0;  // what an element without text means
    if (!text.empty() && (!is_number(text, value) || !std::isfinite(value)))
      fail(fmt::format("{} is no number", path_));
    *target = value * value_scale_ + value_offset_;
  }

  static double* limit(Limits& limits, std::string_view name, std::string_view front) {
    if (!name.starts_with(front)) return nullptr;
    const std::string_view which = name.substr(front.size());
    if (which != "Minimum" && which != "Maximum") return nullptr;
    if (!limits) limits.emplace(0, 0);
    return which == "Minimum" ? &limits->first : &limits->second;
  }

  Contents& contents_;
  std::string path_, text_, wrong_;
  std::vector<std::size_t> lengths_;  ///< of the path above each open element
  double value_scale_ = 1, value_offset_ = 0;
};

struct ParserDeleter {
  void operator()(XML_Parser parser) const { XML_ParserFree(parser); }
};

struct ParserState {
  ContentsBuilder builder;
  XML_Parser parser = nullptr;

  void stop_if_wrong() const {
    if (!builder.wrong().empty()) XML_StopParser(parser, XML_FALSE);
  }
};

void XMLCALL on_begin(void* user, const XML_Char* name, const XML_Char** attributes) {
  auto& state = *static_cast<ParserState*>(user);
  state.builder.begin(name, XmlAttributes(attributes));
  state.stop_if_wrong();
}

void XMLCALL on_end(void* user, const XML_Char*) {
  auto& state = *static_cast<ParserState*>(user);
  state.builder.end();
  state.stop_if_wrong();
}

void XMLCALL on_text(void* user, const XML_Char* text, int length) {
  static_cast<ParserState*>(user)->builder.text({text, static_cast<std::size_t>(length)});
}

/// A quaternion of about unit length is made one of unit length.
void normalise_rotation(const PagedFile& file, std::size_t number, Scan& scan) {
  if (!scan.has_rotation) return;
  double square = 0;
  for (const double v : scan.rotation) square += v * v;
  if (!(square > 0.25 && square < 4)) {
    file.refuse(
        fmt::format("the rotation of scan {} is no unit quaternion: its length is {}", number + 1, std::sqrt(square)));
  }
  for (double& v : scan.rotation) v /= std::sqrt(square);
}

}  // namespace

unsigned Field::bits() const {
  switch (kind) {
    case Kind::integer:
    case Kind::scaled_integer:
      return static_cast<unsigned>(
          std::bit_width(static_cast<std::uint64_t>(maximum) - static_cast<std::uint64_t>(minimum)));
    case Kind::single_float:
      return 32;
    case Kind::double_float:
      return 64;
    case Kind::text:
      return 8;  // at least: its length
  }
  return 0;
}

Contents read_contents(const PagedFile& file) {
  Contents contents;
  const std::unique_ptr<std::remove_pointer_t<XML_Parser>, ParserDeleter> parser(XML_ParserCreate(nullptr));
  if (!parser) file.refuse("no memory to read its XML section");
  ParserState state{ContentsBuilder(contents), parser.get()};
  XML_SetUserData(parser.get(), &state);
  XML_SetElementHandler(parser.get(), on_begin, on_end);
  XML_SetCharacterDataHandler(parser.get(), on_text);
  std::vector<std::byte> piece;
  for (std::uint64_t done = 0; done < file.xml_bytes() || done == 0; done += piece.size()) {
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kReadBytes, file.xml_bytes() - done)));
    file.read(file.xml() + done, piece);
    const bool last = done + piece.size() == file.xml_bytes();
    if (XML_Parse(parser.get(), reinterpret_cast<const char*>(piece.data()), static_cast<int>(piece.size()),
                  last ? XML_TRUE : XML_FALSE) == XML_STATUS_ERROR) {
      const std::string& wrong = state.builder.wrong();
      file.refuse(fmt::format("line {} of the XML section (from byte {} on): {}",
                              XML_GetCurrentLineNumber(parser.get()), file_offset(file.xml()),
                              wrong.empty() ? XML_ErrorString(XML_GetErrorCode(parser.get())) : wrong));
    }
    if (last) break;
  }
  for (std::size_t i = 0; i < contents.scans.size(); ++i) normalise_rotation(file, i, contents.scans[i]);
  return contents;
}

}  // namespace lamina::e57
