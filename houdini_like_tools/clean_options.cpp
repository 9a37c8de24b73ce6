#include "clean_options.h"

#include "numbers.h"

namespace lamina::tools {

void add_clean_options(CLI::App& app, CleanSettings& s, const std::string& group) {
  add_numbers(app, "--clip", ',', 6, "X0,Y0,Z0,X1,Y1,Z1", "take only samples in this box, given by two corners",
              [&s](const std::vector<double>& v) {
                s.pick.clip = Box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
              })
      ->group(group);
  app.add_option("--every", s.pick.every, "take the first of so many samples")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  app.add_option_function<double>(
         "--merge", [&s](double length) { s.merge = length; },
         "leave out samples within LENGTH of another that face the same way; 0: at the same place")
      ->type_name("LENGTH")
      ->group(group);
  app.add_option("--outliers", s.sigma,
                 "leave out samples whose mean distance to their neighbours lies more than so many standard deviations "
                 "above the mean; 0: none")
      ->type_name("T")
      ->capture_default_str()
      ->group(group);
  app.add_option("--neighbours,--neighbors", s.neighbours, "neighbours that --outliers looks at")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  app.add_option("--spacing", s.spacing, "thin out: no two samples nearer than LENGTH; 0: all")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
}

}  // namespace lamina::tools
