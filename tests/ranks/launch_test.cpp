#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "lamina/ranks.h"

namespace lamina {
namespace {

/// An environment variable for a while.
class Variable {
 public:
  Variable(std::string name, const char* value) : name_(std::move(name)) {
    if (const char* before = std::getenv(name_.c_str())) before_ = before, was_set_ = true;
    value != nullptr ? ::setenv(name_.c_str(), value, 1) : ::unsetenv(name_.c_str());
  }
  ~Variable() { was_set_ ? ::setenv(name_.c_str(), before_.c_str(), 1) : ::unsetenv(name_.c_str()); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  std::string name_, before_;
  bool was_set_ = false;
};

TEST(Launch, AloneWithoutALauncher) {
  const Variable a("OMPI_COMM_WORLD_SIZE", nullptr), b("PMI_SIZE", nullptr), c("PMIX_RANK", nullptr);
  const Variable job("SLURM_STEP_NUM_TASKS", "8");  // a batch script, not a task of srun
  EXPECT_EQ(launch().size, 1);
  EXPECT_EQ(launch().rank, 0);
}

TEST(Launch, AsTheLauncherSays) {
  const Variable size("OMPI_COMM_WORLD_SIZE", "5"), rank("OMPI_COMM_WORLD_RANK", "3");
  EXPECT_EQ(launch().size, 5);
  EXPECT_EQ(launch().rank, 3);
}

TEST(Launch, NonsenseIsNoLauncher) {
  const Variable other("PMI_SIZE", nullptr), third("PMIX_RANK", nullptr);
  for (const char* size : {"1", "0", "-4", "two", "3x", ""}) {
    const Variable a("OMPI_COMM_WORLD_SIZE", size), b("OMPI_COMM_WORLD_RANK", "0");
    EXPECT_EQ(launch().size, 1) << size;
  }
  const Variable a("OMPI_COMM_WORLD_SIZE", "2"), b("OMPI_COMM_WORLD_RANK", "2");
  EXPECT_EQ(launch().size, 1);
}

}  // namespace
}  // namespace lamina
