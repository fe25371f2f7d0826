// tests/load/files.h: files made for a test, and the parts of the corpus.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/load/load.h"

namespace lamina::test {

/// A directory of its own for each process, gone at the end.
class Scratch {
 public:
  static const std::filesystem::path& directory() {
    static const Scratch scratch;
    return scratch.directory_;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }

 private:
  Scratch() : directory_(std::filesystem::temp_directory_path() / ("lamina_test_load_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(directory_);
  }
  std::filesystem::path directory_;
};

inline std::string write_file(const std::string& name, const std::string& bytes) {
  const std::string path = (Scratch::directory() / name).string();
  std::filesystem::remove(path);  // some file systems write a file out at once that is cut to nothing and written anew
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path;
}

inline std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline std::string corpus(const std::string& file) { return std::string(LAMINA_TEST_DIR) + "/corpus/" + file; }

/// Where a file of the table is: in the corpus, else in LAMINA_MODELS, else nowhere (empty).
inline std::string find_model(const std::string& file) {
  if (std::filesystem::exists(corpus(file))) return corpus(file);
  const char* const models = std::getenv("LAMINA_MODELS");
  if (models == nullptr) return {};
  const std::string path = std::string(models) + "/" + file;
  return std::filesystem::exists(path) ? path : "";
}

/// The parts below a folder, in order; none if there is no such folder.
inline std::vector<std::filesystem::path> part_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::is_directory(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(".stl") || name.ends_with(".stl.gz") || name.ends_with(".obj") || name.ends_with(".3mf")) {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);
  return files;
}

using FloatTriangle = std::array<float, 9>;

/// A box of twelve triangles, outward.
inline std::vector<FloatTriangle> box_facets(std::array<float, 3> lo, std::array<float, 3> hi) {
  std::vector<FloatTriangle> facets;
  const auto corner = [&](int i) {
    return std::array<float, 3>{i & 1 ? hi[0] : lo[0], i & 2 ? hi[1] : lo[1], i & 4 ? hi[2] : lo[2]};
  };
  for (const auto& [a, b, c, d] : {std::array{0, 2, 3, 1}, std::array{4, 5, 7, 6}, std::array{0, 1, 5, 4},
                                   std::array{2, 6, 7, 3}, std::array{0, 4, 6, 2}, std::array{1, 3, 7, 5}}) {
    for (const auto& [p, q, r] : {std::array{a, b, c}, std::array{a, c, d}}) {
      FloatTriangle facet{};
      for (std::size_t k = 0; k < 3; ++k) {
        facet[k] = corner(p)[k];
        facet[3 + k] = corner(q)[k];
        facet[6 + k] = corner(r)[k];
      }
      facets.push_back(facet);
    }
  }
  return facets;
}

inline std::string binary_stl(const std::vector<FloatTriangle>& facets, std::string header = "made for a test",
                              std::int64_t count = -1) {
  header.resize(80, '\0');
  const auto number = static_cast<std::uint32_t>(count < 0 ? static_cast<std::int64_t>(facets.size()) : count);
  std::string bytes = header + std::string(reinterpret_cast<const char*>(&number), 4);
  for (const FloatTriangle& facet : facets)
    bytes += std::string(12, '\0') + std::string(reinterpret_cast<const char*>(facet.data()), 36) + std::string(2, '\0');
  return bytes;
}

inline std::string ascii_stl(const std::vector<FloatTriangle>& facets, const std::string& line_end = "\n",
                             const std::string& name = "made for a test") {
  std::ostringstream text;
  text.precision(9);
  text << "solid " << name << line_end;
  for (const FloatTriangle& f : facets) {
    text << "  facet normal 0 0 0" << line_end << "    outer loop" << line_end;
    for (std::size_t k = 0; k < 9; k += 3) text << "      vertex " << f[k] << ' ' << f[k + 1] << ' ' << f[k + 2] << line_end;
    text << "    endloop" << line_end << "  endfacet" << line_end;
  }
  text << "endsolid " << name << line_end;
  return text.str();
}

inline const std::vector<FloatTriangle>& unit_box() {
  static const std::vector<FloatTriangle> box = box_facets({0, 0, 0}, {10, 20, 30});
  return box;
}

inline std::string box_obj() {
  return "v 0 0 0\nv 10 0 0\nv 10 20 0\nv 0 20 0\nv 0 0 30\nv 10 0 30\nv 10 20 30\nv 0 20 30\n"
         "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 1 5 8 4\nf 2 3 7 6\n";
}

/// Facets of a part as a sorted list, each beginning with its smallest corner: equal for equal oriented surfaces.
inline std::vector<Triangle> canonical(const Buffer<Triangle>& triangles) {
  std::vector<Triangle> sorted;
  for (Triangle t : triangles) {
    while (t.b < t.a || t.c < t.a) t = {t.b, t.c, t.a};
    sorted.push_back(t);
  }
  std::sort(sorted.begin(), sorted.end(), [](const Triangle& one, const Triangle& other) {
    return std::tie(one.a, one.b, one.c) < std::tie(other.a, other.b, other.c);
  });
  return sorted;
}

/// All triangles of a part where its instances stand.
inline std::vector<Triangle> placed(const Part& part) {
  Buffer<Triangle> all;
  for (const Instance& instance : part.instances) {
    const auto move = [&](const Point3& p) {
      return Point3{p.x + instance.offset.x, p.y + instance.offset.y, p.z + instance.offset.z};
    };
    for (const Triangle& t : part.meshes[instance.mesh].triangles) all.push_back({move(t.a), move(t.b), move(t.c)});
  }
  return canonical(all);
}

inline std::string notes_of(const Part& part) {
  std::string text;
  for (const Note& note : part.notes) text += note.text + "\n";
  return text;
}

/// Loads what has to load; an empty part and a failure otherwise.
inline Part loaded(const std::string& path, const load::LoadOptions& options = {}) {
  Result<Part> part = load::load(path, options);
  if (!part) {
    ADD_FAILURE() << part.error().message;
    Part empty;
    empty.meshes.resize(1);
    return empty;
  }
  return std::move(*part);
}

/// These facets as a file has them, not repaired.
inline Mesh mesh_of(const std::vector<FloatTriangle>& facets) {
  load::LoadOptions options;
  options.repair = false;
  return std::move(loaded(write_file("facets.stl", binary_stl(facets)), options).meshes[0]);
}

/// The message of what has to be refused as input.
inline std::string refusal(const std::string& path, const load::LoadOptions& options = {}) {
  const Result<Part> part = load::load(path, options);
  if (part.ok()) {
    ADD_FAILURE() << path << " was not refused";
    return {};
  }
  EXPECT_EQ(part.error().fault, Fault::kInput) << part.error().message;
  EXPECT_EQ(part.error().message.find('\n'), std::string::npos) << "an error is one line";
  EXPECT_EQ(part.error().message.rfind(path, 0), 0u) << "an error begins with the file: " << part.error().message;
  return part.error().message;
}

#define EXPECT_CONTAINS(text, fragment) \
  EXPECT_NE((text).find(fragment), std::string::npos) << "in: " << (text) << "\nmissing: " << (fragment)

}  // namespace lamina::test
