// PLY files of any layout, written value by value without any of the reader's code.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "points/ply_header.h"

namespace lamina::test {

struct PlyColumnModel {
  std::string name;
  ScalarType type = ScalarType::float32;
  bool list = false;
  ScalarType length_type = ScalarType::uint8;
};

/// cells[row][column]: one value, or a list's values; representable in the column's type.
struct PlyElementModel {
  std::string name;
  std::vector<PlyColumnModel> columns;
  std::vector<std::vector<std::vector<double>>> cells;
};

struct PlyModel {
  std::vector<PlyElementModel> elements;
  std::string line_end = "\n";
  bool sized_names = false;  ///< int8 ... instead of char ...
};

inline std::string type_word(ScalarType type, bool sized) {
  static const char* const words[8][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                          {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                          {"float", "float32"}, {"double", "float64"}};
  return words[static_cast<int>(type)][sized ? 1 : 0];
}

inline void put_bytes(std::string& out, std::uint64_t bits, int bytes, bool big) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>((bits >> (8 * (big ? bytes - 1 - i : i))) & 0xFFU);
}

inline void put_binary(std::string& out, ScalarType type, double value, bool big) {
  std::uint64_t bits = 0;
  if (type == ScalarType::float32) {
    const auto f = static_cast<float>(value);
    std::uint32_t word = 0;
    std::memcpy(&word, &f, 4);
    bits = word;
  } else if (type == ScalarType::float64) {
    std::memcpy(&bits, &value, 8);
  } else {
    bits = static_cast<std::uint64_t>(static_cast<std::int64_t>(value));
  }
  put_bytes(out, bits, byte_size(type), big);
}

inline std::string header_of(const PlyModel& model, PlyFormat format) {
  static const char* const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  const std::string& end = model.line_end;
  std::string text =
      "ply" + end + "format " + names[static_cast<int>(format)] + " 1.0" + end + "comment end_header not yet" + end;
  for (const auto& element : model.elements) {
    text += "element " + element.name + " " + std::to_string(element.cells.size()) + end;
    for (const auto& column : element.columns) {
      text += "property ";
      if (column.list) text += "list " + type_word(column.length_type, model.sized_names) + " ";
      text += type_word(column.type, model.sized_names) + " " + column.name + end;
    }
  }
  return text + "end_header" + end;
}

inline std::string ply_bytes(const PlyModel& model, PlyFormat format) {
  std::string out = header_of(model, format);
  const bool big = format == PlyFormat::big_endian;
  for (const auto& element : model.elements) {
    for (const auto& row : element.cells) {
      for (std::size_t c = 0; c < row.size(); ++c) {
        const auto& column = element.columns[c];
        const auto put = [&](ScalarType type, double value) {
          if (format != PlyFormat::ascii) return put_binary(out, type, value, big);
          char word[64];
          std::snprintf(word, sizeof word, "%.17g ", value);
          out += word;
        };
        if (column.list) put(column.length_type, static_cast<double>(row[c].size()));
        for (const double value : row[c]) put(column.type, value);
      }
      if (format == PlyFormat::ascii) out += model.line_end;
    }
  }
  return out;
}

inline double random_value(ScalarType type, std::mt19937& random) {
  const auto whole = [&](double low, double high) {
    return std::floor(std::uniform_real_distribution<>(low, high + 1)(random));
  };
  switch (type) {
    case ScalarType::int8:
      return whole(-128, 127);
    case ScalarType::uint8:
      return whole(0, 255);
    case ScalarType::int16:
      return whole(-32768, 32767);
    case ScalarType::uint16:
      return whole(0, 65535);
    case ScalarType::int32:
      return whole(-2147483648.0, 2147483647);
    case ScalarType::uint32:
      return whole(0, 4294967295.0);
    case ScalarType::float32:
    case ScalarType::float64:
      break;
  }
  const double special[] = {0, -0.0, std::numeric_limits<double>::infinity(), std::nan(""), 1e-30, -1e30};
  if (random() % 16 == 0)
    return type == ScalarType::float32 ? static_cast<float>(special[random() % 6]) : special[random() % 6];
  const double value = std::normal_distribution<>(0, 1000)(random);
  return type == ScalarType::float32 ? static_cast<float>(value) : value;
}

inline ScalarType random_type(std::mt19937& random) {
  return static_cast<ScalarType>(random() % 8);
}

inline void fill_cells(PlyElementModel& element, std::size_t rows, std::mt19937& random) {
  for (std::size_t r = 0; r < rows; ++r) {
    auto& row = element.cells.emplace_back();
    for (const auto& column : element.columns) {
      auto& cell = row.emplace_back();
      const std::size_t n = column.list ? random() % 5 : 1;
      for (std::size_t i = 0; i < n; ++i) cell.push_back(random_value(column.type, random));
    }
  }
}

/// Some element that is not the points.
inline PlyElementModel random_element(const std::string& name, std::size_t rows, std::mt19937& random) {
  PlyElementModel element{name, {}, {}};
  const std::size_t columns = 1 + random() % 3;
  for (std::size_t c = 0; c < columns; ++c) {
    const auto length_type = static_cast<ScalarType>(random() % 6);  // any integer
    element.columns.push_back({"p" + std::to_string(c), random_type(random), random() % 3 == 0, length_type});
  }
  fill_cells(element, rows, random);
  return element;
}

}  // namespace lamina::test
