#include "points/las_fields.h"

namespace lamina {

std::vector<LasField> las_fields(int point_format) {
  using Type = ScalarType;
  constexpr double kAngleStep = 0.006;
  if (point_format >= 6) {
    return {{"return_number", Type::uint8, 14, 0, 4},
            {"number_of_returns", Type::uint8, 14, 4, 4},
            {"class_flags", Type::uint8, 15, 0, 4},
            {"scanner_channel", Type::uint8, 15, 4, 2},
            {"scan_direction", Type::uint8, 15, 6, 1},
            {"edge_of_flight_line", Type::uint8, 15, 7, 1},
            {"classification", Type::uint8, 16},
            {"user_data", Type::uint8, 17},
            {"scan_angle", Type::int16, 18, 0, 0, kAngleStep},
            {"point_source", Type::uint16, 20},
            {"gps_time", Type::float64, 22}};
  }
  std::vector<LasField> fields{{"return_number", Type::uint8, 14, 0, 3},
                               {"number_of_returns", Type::uint8, 14, 3, 3},
                               {"scan_direction", Type::uint8, 14, 6, 1},
                               {"edge_of_flight_line", Type::uint8, 14, 7, 1},
                               {"classification", Type::uint8, 15, 0, 5},
                               {"class_flags", Type::uint8, 15, 5, 3},
                               {"scan_angle", Type::int8, 16},
                               {"user_data", Type::uint8, 17},
                               {"point_source", Type::uint16, 18}};
  if (point_format == 1 || point_format >= 3) fields.push_back({"gps_time", Type::float64, 20});
  return fields;
}

}  // namespace lamina
