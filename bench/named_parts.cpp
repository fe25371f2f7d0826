#include "bench/named_parts.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>

#include "stages/load/load.h"

namespace lamina::bench {
namespace {

constexpr std::array kNamedParts{
    NamedPart{"nut", "parameter_quality_nut.stl", 414},
    NamedPart{"nist", "nist_am_test_artifact_v3b.stl", 7392},
    NamedPart{"herringbone", "herringbone_wheels_x4.stl", 71974},
    NamedPart{"nefertiti_obj", "nefertiti.obj", 99938},
    NamedPart{"gears_3mf", "cube_gears_17_items.3mf", 25692},
    NamedPart{"benchy_3mf", "3DBenchy.3mf", 225154},
    NamedPart{"gyroid_gz", "gyroid_sheet_cyl_247k.stl.gz", 246820},
    NamedPart{"terrain_gz", "st_helens_terrain_645k.stl.gz", 645364},
};

constexpr NamedJob kNamedJobs[] = {
    {"terrain", "terrain.stl", 100'000'000, 100'000},     {"benchy", "benchy15.stl", 100'000'000, 100'000},
    {"crowns-20", "crowns96.stl", 400'000'000, 480'000},  {"crowns-96", "crowns96.stl", 400'000'000, 100'000},
    {"benchies", "benchies72.stl", 400'000'000, 100'000}, {"knot800k", "knot800k.stl", 100'000'000, 50'000},
    {"scan680k", "scan680k.stl", 100'000'000, 100'000},
};

/// Path of a file in the folder that an environment variable names; empty without either.
std::string path_in(const char* variable, const char* file) {
  const char* folder = std::getenv(variable);
  if (folder == nullptr) return {};
  const std::string path = std::string(folder) + "/" + file;
  return std::filesystem::exists(path) ? path : std::string();
}

}  // namespace

std::span<const NamedPart> named_parts() { return kNamedParts; }

std::string model_path(const NamedPart& part) { return path_in("LAMINA_MODELS", part.file); }

std::span<const NamedJob> named_jobs() { return kNamedJobs; }

std::string job_path(const NamedJob& job) { return path_in("LAMINA_BENCH_PARTS", job.file); }

bool load_on_bed(benchmark::State& state, const std::string& path, std::int64_t x, std::int64_t y, Part& part) {
  auto loaded = load::load(path, {});
  if (!loaded) {
    state.SkipWithError(loaded.error().message.c_str());
    return false;
  }
  part = std::move(*loaded);
  const Point3 low = part.bounds.lo;
  const auto move = [](Nm value, std::int64_t by) { return static_cast<Nm>(value + by); };
  for (Instance& instance : part.instances) {
    instance.offset = {move(instance.offset.x, x - low.x), move(instance.offset.y, y - low.y),
                       move(instance.offset.z, -std::int64_t{low.z})};
  }
  return true;
}

PixelGrid snug_grid(const Part& part, std::int64_t dpi) {
  return {{dpi, part.bounds.width() + 2 * kNmPerMm}, {dpi, part.bounds.depth() + 2 * kNmPerMm}};
}

Buffer<Triangle> flattened(const Part& part) {
  Buffer<Triangle> all;
  for (const Instance& instance : part.instances) {
    const Point3 by = instance.offset;
    const auto moved = [by](const Point3& p) { return Point3{p.x + by.x, p.y + by.y, p.z + by.z}; };
    for (const Triangle& triangle : part.meshes[instance.mesh].triangles) {
      all.push_back({moved(triangle.a), moved(triangle.b), moved(triangle.c)});
    }
  }
  return all;
}

bool same_runs(const RunsView& a, const RunsView& b) {
  return a.columns == b.columns && std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change);
}

}  // namespace lamina::bench
