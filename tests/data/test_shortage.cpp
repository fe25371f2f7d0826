// A lack of memory or of open files is no damage of a file, and names what is needed.
#include "stages/data/shortage.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <limits>
#include <new>
#include <system_error>

#include "stages/data/buffer.h"

namespace lamina {
namespace {

Result<int> damaged(int reason) {
  errno = reason;
  return Error{Fault::kInput, "part.png: damaged"};
}

TEST(Shortage, InErrnoIsNoDamage) {
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  const auto no_file = report_shortages("part.png", [] { return damaged(EMFILE); });
  EXPECT_EQ(no_file.error().fault, Fault::kMemory);
  EXPECT_EQ(no_file.error().message, "part.png: too many open files: needs more than " + std::to_string(files.rlim_cur) +
                                         "; raise the limit (ulimit -n)");
  EXPECT_EQ(report_shortages("part.png", [] { return damaged(ENOMEM); }).error().fault, Fault::kMemory);
  errno = ENOMEM;  // of earlier calls
  const auto damage = report_shortages("part.png", [] { return errno == 0 ? damaged(EIO) : Result<int>(1); });
  ASSERT_FALSE(damage.ok());
  EXPECT_EQ(damage.error().message, "part.png: damaged");
}

TEST(Shortage, OfMemoryNamesTheBlockThatWasRefused) {
  constexpr std::uint64_t kBlock = std::uint64_t{1} << 60;
  const auto refused = report_shortages("part.png", []() -> Result<int> {
    note_refused_block(kBlock);  // as Buffer does: the address sanitizer ends a program that requests so much
    throw std::bad_alloc();
  });
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().fault, Fault::kMemory);
  EXPECT_GE(needed_address_space(), kBlock);
  EXPECT_NE(refused.error().message.find("needs more than " + std::to_string(needed_address_space() >> 20) + " MiB"),
            std::string::npos)
      << refused.error().message;
  note_refused_block(0);
  EXPECT_LT(needed_address_space(), kBlock);
}

TEST(Shortage, IsRememberedOnce) {
  take_shortage();
  EXPECT_EQ(take_shortage(), 0);
  static_cast<void>(shortage(std::system_error(EMFILE, std::generic_category()), "part.png"));
  EXPECT_EQ(take_shortage(), EMFILE);
  EXPECT_EQ(take_shortage(), 0);
}

}  // namespace
}  // namespace lamina
