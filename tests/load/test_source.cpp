// tests/load/test_source.cpp: files that are no files, gzip, and what happens to thousands of damaged ones.
#include "stages/load/source.h"

#include <sys/stat.h>

#include <random>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

TEST(OpenPart, WhatIsNoFileIsSaidToBeNone) {
  EXPECT_CONTAINS(refusal((Scratch::directory() / "missing.stl").string()), "No such file");
  EXPECT_CONTAINS(refusal(Scratch::directory().string()), "is a directory");
  EXPECT_CONTAINS(refusal(write_file("empty.stl", "")), "is empty");
  EXPECT_CONTAINS(refusal("/dev/null"), "is not a regular file");
  const std::string pipe = (Scratch::directory() / "pipe").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_CONTAINS(refusal(pipe), "is not a regular file");
}

TEST(OpenPart, UnreadableFileIsRefused) {
  const std::string path = write_file("secret.stl", binary_stl(unit_box()));
  ::chmod(path.c_str(), 0);
  if (::access(path.c_str(), R_OK) == 0) GTEST_SKIP() << "this user may read everything";
  EXPECT_CONTAINS(refusal(path), "Permission denied");
}

TEST(OpenPart, NoiseIsRefused) {
  std::mt19937 random(6);
  for (const char* name : {"noise.stl", "noise.obj", "noise.3mf", "noise.stl.gz", "noise"}) {
    for (const std::size_t size : {1u, 2u, 83u, 84u, 85u, 134u, 4096u}) {
      std::string bytes(size, '\0');
      for (char& c : bytes) c = static_cast<char>(random());
      EXPECT_FALSE(refusal(write_file(name, bytes)).empty()) << name << size;
    }
  }
}

TEST(Gzip, HoldsWhatItHolds) {
  const std::vector<Triangle> expected = placed(loaded(write_file("box.stl", binary_stl(unit_box()))));
  EXPECT_EQ(placed(loaded(write_file("box.stl.gz", gzip(binary_stl(unit_box()))))), expected);
  EXPECT_EQ(placed(loaded(write_file("box.stl.gz", gzip(ascii_stl(unit_box()))))), expected);
  EXPECT_EQ(loaded(write_file("box.obj.gz", gzip(box_obj()))).meshes[0].triangles.size(), 12u);
  EXPECT_EQ(placed(loaded(write_file("box.stl", gzip(binary_stl(unit_box()))))), expected) << "regardless of its name";
}

TEST(Gzip, MembersFollowEachOtherAndPaddingIsIgnored) {
  const std::string text = ascii_stl(unit_box());
  const std::string members = gzip(text.substr(0, 500)) + gzip("") + gzip(text.substr(500));
  EXPECT_EQ(loaded(write_file("members.gz", members)).meshes[0].triangles.size(), 12u);
  EXPECT_EQ(loaded(write_file("padded.gz", members + std::string(512, '\0'))).meshes[0].triangles.size(), 12u);
}

TEST(Gzip, TruncatedAtEveryLengthIsRefused) {
  const std::string whole = gzip(binary_stl(unit_box()));
  for (std::size_t length = 2; length < whole.size(); ++length)
    ASSERT_FALSE(refusal(write_file("cut.stl.gz", whole.substr(0, length))).empty()) << length;
}

TEST(Gzip, DamageIsNoticed) {
  std::string bytes = gzip(binary_stl(unit_box()));
  bytes[bytes.size() - 6] ^= 1;  // the checksum
  EXPECT_CONTAINS(refusal(write_file("damaged.stl.gz", bytes)), "gzip data is damaged");
}

TEST(Gzip, BombsAreRefusedEarly) {
  EXPECT_CONTAINS(refusal(write_file("bomb.stl.gz", gzip(std::string(100u << 20, ' ')))), "expands more than 200-fold");
  load::LoadOptions options;
  options.expanded_limit = 500;
  EXPECT_CONTAINS(refusal(write_file("limit.stl.gz", gzip(binary_stl(unit_box()))), options),
                  "more than the limit of 500 bytes");
  EXPECT_CONTAINS(refusal(write_file("nested.gz", gzip(gzip(binary_stl(unit_box()))))), "inflate it once");
}

TEST(Gzip, SizeInTheTrailerIsOnlyAHint) {
  std::string bytes = gzip(binary_stl(unit_box()));
  for (std::size_t i = 1; i <= 4; ++i) bytes[bytes.size() - i] = '\xff';
  EXPECT_FALSE(refusal(write_file("lie.stl.gz", bytes)).empty());
}

/// Changes, cuts and doubles pieces of a file, the same ones every time.
std::string mutated(std::string bytes, std::mt19937& random) {
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes && !bytes.empty(); ++i) {
    const std::size_t at = random() % bytes.size();
    const std::size_t length = std::min<std::size_t>(bytes.size() - at, 1 + random() % 12);
    switch (random() % 6) {
      case 0: bytes[at] = static_cast<char>(random()); break;
      case 1: bytes[at] ^= static_cast<char>(1 << random() % 8); break;
      case 2: bytes.erase(at, length); break;
      case 3: bytes.insert(at, bytes.substr(at, length)); break;
      case 4: bytes.replace(at, length, std::string(length, "09-.e/\n\\ \xff"[random() % 10])); break;
      default: bytes.resize(at); break;
    }
  }
  return bytes;
}

class Mutations : public ::testing::TestWithParam<std::pair<const char*, int>> {};

TEST_P(Mutations, EndInAPartOrInALine) {
  const auto [kind, count] = GetParam();
  const std::string name = kind;
  const std::string model_3mf =
      model(box_object(1, 10, 20, 30) + components(2, component(1) + component(1, "1 0 0 0 1 0 0 0 1 20 0 0")), item(2));
  const std::string whole = name == "binary.stl"  ? binary_stl(unit_box())
                            : name == "ascii.stl" ? ascii_stl(unit_box())
                            : name == "box.obj"   ? box_obj()
                            : name == "box.gz"    ? gzip(binary_stl(unit_box()))
                            : name == "model.3mf" ? model_3mf
                                                  : zip(package(model_3mf));
  std::mt19937 random(7);
  int parts = 0;
  for (int i = 0; i < count; ++i) {
    std::string bytes = mutated(whole, random);
    if (name == "model.3mf") bytes = zip(package(bytes));  // a sound zip around a damaged model
    load::LoadOptions options;
    options.drop_bad = i % 2 == 0;
    const Result<Part> part = load::load(write_file("mutated_" + name, bytes), options);
    if (!part) {
      ASSERT_EQ(part.error().fault, Fault::kInput) << i << ": " << part.error().message;
      ASSERT_EQ(part.error().message.find('\n'), std::string::npos) << i << ": " << part.error().message;
      continue;
    }
    ++parts;
    ASSERT_FALSE(part->instances.empty());
    for (const Mesh& mesh : part->meshes) ASSERT_LE(mesh.repaired_from, mesh.triangles.size());
  }
  EXPECT_GT(parts, name == "box.gz" ? -1 : 0) << "no mutation was harmless: is the file itself sound?";
}

INSTANTIATE_TEST_SUITE_P(Every, Mutations,
                         ::testing::Values(std::pair{"binary.stl", 1500}, std::pair{"ascii.stl", 1500},
                                           std::pair{"box.obj", 1500}, std::pair{"box.gz", 1000}, std::pair{"model.3mf", 1500},
                                           std::pair{"package.3mf", 1000}),
                         [](const auto& one) {
                           std::string name = one.param.first;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

}  // namespace
}  // namespace lamina::test
