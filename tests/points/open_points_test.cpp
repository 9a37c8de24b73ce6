// Whole files through open_points: every format, type and order against an independent writer; damage; real scans.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <thread>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "points/ply_files.h"
#include "support/paths.h"

namespace lamina {
namespace {

using test::PlyElementModel;
using test::PlyModel;
using testing::HasSubstr;

constexpr PlyFormat kFormats[] = {PlyFormat::ascii, PlyFormat::little_endian, PlyFormat::big_endian};

/// Points with any set of properties in any order, other elements around them.
PlyModel random_cloud(std::mt19937& random, std::size_t rows) {
  PlyElementModel vertices{"vertex", {}, {}};
  const auto add = [&](const char* name) { vertices.columns.push_back({name, test::random_type(random)}); };
  for (const char* name : {"x", "y", "z"}) add(name);
  if (random() % 2 != 0) {
    for (const char* name : {"nx", "ny", "nz"}) add(name);
  }
  for (const char* name : {"radius", "pscale", "quality", "confidence", "red", "green", "blue", "label"}) {
    if (random() % 2 != 0) add(name);
  }
  std::shuffle(vertices.columns.begin(), vertices.columns.end(), random);
  test::fill_cells(vertices, rows, random);
  PlyModel model;
  for (std::size_t i = random() % 3; i > 0; --i) {
    model.elements.push_back(test::random_element("before" + std::to_string(i), random() % 20, random));
  }
  model.elements.push_back(std::move(vertices));
  for (std::size_t i = random() % 3; i > 0; --i) {
    model.elements.push_back(test::random_element("after" + std::to_string(i), random() % 20, random));
  }
  model.line_end = random() % 2 != 0 ? "\n" : "\r\n";
  model.sized_names = random() % 2 != 0;
  return model;
}

const PlyElementModel& vertices_of(const PlyModel& model) {
  return *std::find_if(model.elements.begin(), model.elements.end(), [](const auto& e) { return e.name == "vertex"; });
}

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// Compares the rows of a batch with the model, finding the place of each property by its meaning.
void expect_rows(const PlyElementModel& vertices, const PointSourceInfo& info, const SampleBatch& batch) {
  const auto has = [&](const std::string& name) {
    return std::any_of(vertices.columns.begin(), vertices.columns.end(), [&](const auto& c) { return c.name == name; });
  };
  std::size_t attribute = 0;
  for (std::size_t c = 0; c < vertices.columns.size(); ++c) {
    const auto& [name, type, list, length] = vertices.columns[c];
    const std::vector<double>* wide = name == "x"   ? &batch.x
                                      : name == "y" ? &batch.y
                                      : name == "z" ? &batch.z
                                                    : nullptr;
    const std::vector<float>* narrow = nullptr;
    if (name == "nx") narrow = &batch.nx;
    if (name == "ny") narrow = &batch.ny;
    if (name == "nz") narrow = &batch.nz;
    if (name == "radius" || (name == "pscale" && !has("radius"))) narrow = &batch.radius;
    if (name == "quality" || (name == "confidence" && !has("quality"))) narrow = &batch.quality;
    if (wide == nullptr && narrow == nullptr) {
      ASSERT_LT(attribute, info.attributes.size());
      EXPECT_EQ(info.attributes[attribute], (AttributeSpec{name, type}));
      narrow = &batch.attributes[attribute++];
    }
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const double expected = vertices.cells[batch.first + i][c][0];
      if (wide != nullptr) {
        ASSERT_TRUE(same((*wide)[i], expected)) << name << " of row " << batch.first + i;
      } else {
        ASSERT_EQ(narrow->size(), batch.size()) << name;
        ASSERT_TRUE(same((*narrow)[i], static_cast<float>(expected))) << name << " of row " << batch.first + i;
      }
    }
  }
  EXPECT_EQ(attribute, info.attributes.size());
}

TEST(OpenPoints, ReadsEveryLayoutAsWritten) {
  const test::TemporaryFolder folder;
  for (unsigned seed = 0; seed < 150; ++seed) {
    std::mt19937 random(seed);
    const std::size_t rows = random() % 5 == 0 ? random() % 3 : random() % 300;
    const PlyModel model = random_cloud(random, rows);
    for (const PlyFormat format : kFormats) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << " format " << static_cast<int>(format));
      const auto source = open_points(test::write_file(folder / "cloud.ply", test::ply_bytes(model, format)));
      EXPECT_EQ(source->info().count, rows);
      EXPECT_EQ(source->info().random_access, format != PlyFormat::ascii);
      SampleBatch batch;
      for (int pass = 0; pass < 2; ++pass) {  // the second starts over
        for (std::size_t first = 0; first < rows;) {
          const std::size_t count = 1 + random() % 200;
          source->read(first, count, batch);
          ASSERT_EQ(batch.first, first);
          ASSERT_EQ(batch.size(), std::min(count, rows - first));
          expect_rows(vertices_of(model), source->info(), batch);
          first += batch.size();
        }
      }
      source->read(rows, 10, batch);
      EXPECT_EQ(batch.size(), 0);
    }
  }
}

TEST(OpenPoints, ReadsBinaryAtRandomFromManyThreads) {
  std::mt19937 random(7);
  const std::size_t rows = 20'000;  // more than one buffer
  const PlyModel model = random_cloud(random, rows);
  const test::TemporaryFolder folder;
  const auto source =
      open_points(test::write_file(folder / "cloud.ply", test::ply_bytes(model, PlyFormat::little_endian)));
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      std::mt19937 mine(t);
      SampleBatch batch;
      for (int i = 0; i < 20; ++i) {
        source->read(mine() % rows, mine() % 9000, batch);
        expect_rows(vertices_of(model), source->info(), batch);
      }
    });
  }
  for (auto& thread : threads) thread.join();
}

TEST(OpenPoints, DamagedFilesAreReadOrRefusedNeverWorse) {
  const test::TemporaryFolder folder;
  std::size_t refused = 0;
  std::size_t tried = 0;
  const auto attempt = [&](const std::string& bytes) {
    const std::string path = test::write_file(folder / "damaged.ply", bytes);
    ++tried;
    try {
      const auto source = open_points(path);
      // What the header promises must be possible before anyone allocates for it.
      ASSERT_LE(source->info().count, bytes.size());
      SampleBatch batch;
      for (std::uint64_t first = 0; first < source->info().count; first += batch.size()) source->read(first, 37, batch);
    } catch (const Error& e) {
      ++refused;
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      EXPECT_THAT(e.what(), HasSubstr("damaged.ply"));
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  };
  std::mt19937 random(3);
  for (const PlyFormat format : kFormats) {
    PlyModel model;
    model.elements.push_back(test::random_element("before", 9, random));
    model.elements.back().columns.push_back({"ids", ScalarType::int32, true, ScalarType::int32});
    for (auto& row : model.elements.back().cells) row.push_back({1, 2, 3});
    PlyModel cloud = random_cloud(random, 30);
    model.elements.push_back(vertices_of(cloud));
    model.elements.push_back(test::random_element("after", 9, random));
    const std::string good = test::ply_bytes(model, format);
    for (std::size_t size = 0; size < good.size(); ++size) {
      attempt(good.substr(0, size));
      if (HasFatalFailure()) return;
    }
    // Every cut shows, but in an ascii file those inside the last line.
    const std::size_t last_line = good.size() - good.find_last_of('\n', good.size() - 2);
    EXPECT_GE(refused + (format == PlyFormat::ascii ? last_line : 0), tried);
    for (int i = 0; i < 1500; ++i) {
      std::string bad = good;
      for (std::size_t flips = 1 + random() % 3; flips > 0; --flips) {
        bad[random() % bad.size()] = static_cast<char>(random() % 2 != 0 ? random() : '0' + random() % 10);
      }
      attempt(bad);
      if (HasFatalFailure()) return;
    }
    refused = tried = 0;
  }
}

std::string refusal(const std::string& path, const std::string& tmp_dir = {}) {
  try {
    open_points(path, tmp_dir);
  } catch (const Error& e) {
    return e.what();
  }
  return "nothing";
}

TEST(OpenPoints, RefusesWhatIsNoFile) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal(folder / "none.ply"), HasSubstr("none.ply: cannot be opened: No such file"));
  EXPECT_THAT(refusal(folder.path()), HasSubstr("is a directory"));
  EXPECT_THAT(refusal(test::write_file(folder / "empty.ply", "")), HasSubstr("empty.ply: is empty"));
}

TEST(OpenPoints, ReadsStandardInputFromAPipe) {
  std::mt19937 random(1);
  const PlyModel model = random_cloud(random, 5000);
  for (const PlyFormat format : kFormats) {
    const test::TemporaryFolder folder;
    const std::string bytes = test::ply_bytes(model, format);
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    std::thread writer([&] {
      for (std::size_t at = 0; at < bytes.size();) {
        at += static_cast<std::size_t>(
            ::write(ends[1], bytes.data() + at, std::min<std::size_t>(777, bytes.size() - at)));
      }
      ::close(ends[1]);
    });
    {
      const test::Redirected standard_input(STDIN_FILENO, ends[0]);
      const auto source = open_points("-", folder.path());
      EXPECT_EQ(source->info().path, "-");
      EXPECT_EQ(folder.entries(), 0);  // the spooled file has no name
      SampleBatch batch;
      source->read(0, 5000, batch);
      EXPECT_EQ(batch.size(), 5000);
      expect_rows(vertices_of(model), source->info(), batch);
    }
    writer.join();
    ::close(ends[0]);
  }
}

TEST(OpenPoints, StandardInputFromAFileNeedsNoCopy) {
  const test::TemporaryFolder folder;
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n";
  const int file = ::open(test::write_file(folder / "a.ply", "skip" + text).c_str(), O_RDONLY);
  {
    const test::Redirected standard_input(STDIN_FILENO, file);
    EXPECT_THAT(refusal("-", folder / "none"), HasSubstr("standard input: is no point file"));
    ::lseek(file, 4, SEEK_SET);  // begun: taken like a pipe
    EXPECT_EQ(open_points("-", folder.path())->info().count, 1);
  }
  ::close(file);
  const int whole = ::open(test::write_file(folder / "a.ply", text).c_str(), O_RDONLY);
  {
    const test::Redirected standard_input(STDIN_FILENO, whole);
    EXPECT_EQ(open_points("-", folder / "none")->info().count, 1);
  }
  ::close(whole);
}

TEST(OpenPoints, StandardInputErrorsNameIt) {
  const test::TemporaryFolder folder;
  const auto from_pipe = [&](const std::string& bytes, const std::string& tmp_dir) {
    int ends[2];
    EXPECT_EQ(::pipe(ends), 0);
    EXPECT_EQ(::write(ends[1], bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    ::close(ends[1]);
    const test::Redirected standard_input(STDIN_FILENO, ends[0]);
    ::close(ends[0]);
    return refusal("-", tmp_dir);
  };
  EXPECT_THAT(from_pipe("", folder.path()), HasSubstr("standard input: is empty"));
  EXPECT_THAT(from_pipe("LASF....", folder.path()), HasSubstr("standard input: the LAS header is cut short"));
  EXPECT_THAT(from_pipe("ply\nformat ascii 1.0\n", folder / "none"), HasSubstr("cannot make a temporary file here"));
}

TEST(OpenPoints, NamedPipesAndEndlessDevices) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal("/dev/zero", folder.path()), HasSubstr("/dev/zero: is no point file"));
  const std::string fifo = folder / "pipe.ply";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  std::thread writer([&] {
    test::write_file(
        fifo,
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n");
  });
  const auto source = open_points(fifo, folder.path());
  SampleBatch batch;
  source->read(0, 1, batch);
  EXPECT_EQ(batch.z, std::vector<double>{3});
  writer.join();
}

struct Scan {
  const char* file;
  std::uint64_t count;
  bool normals, quality, wide;
  std::vector<std::string> attributes;
};

TEST(OpenPoints, ReadsRealScans) {
  const std::string folder = LAMINA_SOURCE_DIR "/../shared/data/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const Scan scans[] = {{"bunny_scans.ply", 361'817, true, true, false, {"scan"}},
                        {"lion_normals_rgb.ply", 341'989, true, false, true, {"red", "green", "blue"}},
                        {"b9_training.ply", 22'300, false, false, true, {"red", "green", "blue", "label"}},
                        {"bun_zipper.ply", 35'947, false, true, false, {"intensity"}}};
  for (const Scan& scan : scans) {
    SCOPED_TRACE(scan.file);
    const auto source = open_points(folder + scan.file);
    const PointSourceInfo& info = source->info();
    EXPECT_EQ(info.count, scan.count);
    EXPECT_EQ(info.has_normals, scan.normals);
    EXPECT_EQ(info.has_quality, scan.quality);
    EXPECT_EQ(info.double_precision, scan.wide);
    std::vector<std::string> names;
    for (const auto& attribute : info.attributes) names.push_back(attribute.name);
    EXPECT_EQ(names, scan.attributes);
    SampleBatch batch;
    std::uint64_t read = 0;
    std::uint64_t unit_normals = 0;
    while (read < info.count) {
      source->read(read, 50'000, batch);
      read += batch.size();
      for (std::size_t i = 0; i < batch.size(); ++i) {
        ASSERT_TRUE(std::isfinite(batch.x[i]) && std::isfinite(batch.y[i]) && std::isfinite(batch.z[i]));
        if (scan.normals)
          unit_normals += std::abs(std::hypot(batch.nx[i], batch.ny[i], batch.nz[i]) - 1.0F) < 0.01F ? 1 : 0;
      }
    }
    EXPECT_EQ(read, scan.count);
    if (scan.normals) {
      EXPECT_GT(unit_normals, scan.count * 99 / 100);
    }
  }
}

}  // namespace
}  // namespace lamina
