// stages/load/load.cpp: a file goes to the reader of its format, and its meshes are checked, closed and described.
#include "stages/load/load.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <string_view>

#include "stages/data/shortage.h"
#include "stages/load/matrix.h"
#include "stages/load/obj.h"
#include "stages/load/repair/finish.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/stl_ascii.h"
#include "stages/load/stl_binary.h"
#include "stages/load/text.h"
#include "stages/load/threemf/threemf.h"
#include "stages/load/unsupported/unsupported.h"

namespace lamina::load {
namespace {

/// Sine and cosine; quarter turns are exact, so that a part turned by 90 degrees keeps every bit.
void sine_cosine(double degrees, double& sine, double& cosine) {
  const double turn = std::remainder(degrees, 360.0);  // exact
  if (turn == 0) {
    sine = 0, cosine = 1;
  } else if (turn == 90) {
    sine = 1, cosine = 0;
  } else if (turn == -90) {
    sine = -1, cosine = 0;
  } else if (turn == 180 || turn == -180) {
    sine = 0, cosine = -1;
  } else {
    const double radians = turn * 3.14159265358979323846 / 180.0;
    sine = std::sin(radians), cosine = std::cos(radians);
  }
}

enum class Format { kBinaryStl, kAsciiStl, kObj, k3mf, kGzip };

constexpr std::size_t kHead = 4096;

bool ends_with(std::string_view path, std::string_view lower_case) {
  return path.size() >= lower_case.size() && is_word(path.substr(path.size() - lower_case.size()), lower_case);
}

/// Binary STL has zero bytes in its first facets; text, in whatever encoding, has none (but for padding at its end),
/// nor other control characters.
bool is_text(std::string_view head) {
  head = head.substr(0, head.find_last_not_of('\0') + 1);
  return std::none_of(head.begin(), head.end(),
                      [](char c) { return c == '\0' || (c > 0 && c < 32 && !is_space(c)) || c == 127; });
}

/// First words of lines decide between the text formats.
bool has_line_with(std::string_view head, std::initializer_list<std::string_view> words) {
  std::size_t at = 0;
  while (at < head.size()) {
    while (at < head.size() && is_space(head[at])) ++at;
    const std::size_t begin = at;
    while (at < head.size() && !is_space(head[at])) ++at;
    for (const std::string_view word : words)
      if (is_word(head.substr(begin, at - begin), word)) return true;
    while (at < head.size() && !is_line_end(head[at])) ++at;
  }
  return false;
}

/// The size that a binary STL file's own count asks for. In text, the count's bytes are characters and ask for
/// more than 7 GB, so the test decides whatever the header says.
bool has_binary_stl_size(const Source& source, std::string_view head) {
  if (head.size() < 84) return false;
  std::uint64_t count = 0;
  for (std::size_t i = 4; i-- > 0;) count = count << 8 | static_cast<unsigned char>(head[80 + i]);
  return source.size() == 84 + 50 * count;
}

/// Tells the format from the content, and from the name where the content is text that could be anything.
/// errors  kInput: empty, or nothing that is known
Result<Format> detect(const Source& source) {
  if (source.size() == 0) return source.error("is empty; export the part again");
  std::array<char, kHead> bytes;
  std::string_view head = source.head(bytes);
  if (head.empty()) return source.changed_while_read();
  if (head.substr(0, 4) == "PK\x03\x04" || head.substr(0, 4) == std::string_view("PK\x05\x06", 4)) return Format::k3mf;
  if (head.substr(0, 2) == "\x1f\x8b") return Format::kGzip;
  if (has_binary_stl_size(source, head)) return Format::kBinaryStl;
  if (const Status known = refuse_unsupported(source, head); !known) return known.error();
  if (head.substr(0, 3) == "\xef\xbb\xbf") head.remove_prefix(3);
  std::string_view name = source.path();
  if (ends_with(name, ".gz")) name.remove_suffix(3);
  if (is_text(head)) {
    if (has_line_with(head, {"solid", "facet", "endsolid"}) && !ends_with(name, ".obj")) return Format::kAsciiStl;
    if (has_line_with(head, {"v", "f"})) return Format::kObj;
    if (ends_with(name, ".obj") && !is_machine_program(head)) return Format::kObj;
    if (has_line_with(head, {"#", "o", "g", "mtllib", "vn", "vt"}) && !ends_with(name, ".stl")) return Format::kObj;
    if (is_machine_program(head)) return source.error("is G-code, the moves of a machine; name the part that it was made of");
    return source.error("is text, but neither STL nor OBJ; export the part again");
  }
  if (ends_with(name, ".3mf")) return source.error("is not a zip file, as 3MF is; copy or export it again");
  if (ends_with(name, ".obj")) return source.error("is not text, as OBJ is; copy or export it again");
  if (ends_with(name, ".stl")) return Format::kBinaryStl;
  return source.error("is neither STL, OBJ nor 3MF; export the part as one of these");
}

/// Opens a file and inflates it if need be.
Result<Source> open_plain(const std::string& path, const LoadOptions& options, Format& format, bool& was_gzip) {
  Result<Source> source = Source::open(path);
  if (!source) return source;
  Result<Format> found = detect(*source);
  if (!found) return found.error();
  was_gzip = *found == Format::kGzip;
  if (was_gzip) {
    source = inflate_gzip(*source, options.expanded_limit);
    if (!source) return source;
    found = detect(*source);
    if (!found) return found.error();
    if (*found == Format::kGzip || *found == Format::k3mf)
      return source->error("is a compressed file within a gzip file; inflate it once");
  }
  format = *found;
  return source;
}

Result<Facets> read_facets(const Source& source, Format format, const LoadOptions& options) {
  const Snapper snapper(options.transform, options.unit_mm);
  switch (format) {
    case Format::kBinaryStl: return read_binary_stl(source, snapper, options);
    case Format::kAsciiStl: return read_ascii_stl(source, snapper, options);
    default: return read_obj(source, snapper, options);
  }
}

/// Refuses what cannot leave a single pixel.
Status check_extent(const Source& source, const Part& part) {
  const bool any_area = std::any_of(part.meshes.begin(), part.meshes.end(), [](const Mesh& mesh) {
    // Blocks come of meshes that enclose something.
    return mesh.blocks != nullptr || std::any_of(mesh.triangles.begin(), mesh.triangles.end(), has_area);
  });
  if (part.bounds.empty()) return source.error("holds no facets");
  if (part.bounds.height() == 0)
    return source.error(fmt::format("has no height: nothing to print (all of it lies at z = {:.6g} mm)", mm(part.bounds.lo.z)));
  if (part.bounds.width() == 0 || part.bounds.depth() == 0)
    return source.error(fmt::format("has no {}: nothing to print", part.bounds.width() == 0 ? "width" : "depth"));
  if (!any_area) return source.error("all facets are degenerate: nothing to print");
  return {};
}

/// STL and OBJ carry no unit; a part smaller than a thumbnail was often drawn in another one.
void hint_at_unit(Part& part) {
  const double largest = mm(std::max({part.bounds.width(), part.bounds.depth(), part.bounds.height()}));
  if (largest >= 10) return;
  part.notes.push_back({false, fmt::format("the largest side is {:.4g} mm{}", largest,
                                           largest < 1 ? "; is the unit right? The file carries none: try --unit inch, cm or m"
                                                       : "; if the file was drawn in inches, say --unit inch")});
}

Status add_bounds(const Source& source, Part& part) {
  for (const Instance& instance : part.instances) {
    const Box& box = part.meshes[instance.mesh].bounds;
    if (box.empty()) continue;
    for (const Point3& corner : {box.lo, box.hi}) {
      const std::int64_t x = std::int64_t{corner.x} + instance.offset.x, y = std::int64_t{corner.y} + instance.offset.y,
                         z = std::int64_t{corner.z} + instance.offset.z;
      if (std::max({std::abs(x), std::abs(y), std::abs(z)}) > kNmReach)
        return source.error(what_is_wrong(Snapped::kBeyondReach));
      part.bounds.add(Point3{static_cast<Nm>(x), static_cast<Nm>(y), static_cast<Nm>(z)});
    }
  }
  return {};
}

Result<Part> load_unguarded(const std::string& path, const LoadOptions& options, const SeeTriangles& see) {
  Part part;
  part.path = path;
  Format format{};
  bool was_gzip = false;
  const Result<Source> source = open_plain(path, options, format, was_gzip);
  if (!source) return source.error();
  if (format == Format::k3mf) {
    Result<Package> package = read_3mf(*source, options);
    if (!package) return package.error();
    part.notes = std::move(package->notes);
    for (PlacedObject& object : package->objects) {
      const std::string prefix = package->objects.size() > 1 ? object.name + ": " : "";
      Result<Mesh> mesh = finish(*source, path + ": " + object.name, prefix, std::move(object.facets), options, part.notes);
      if (!mesh) return mesh.error();
      for (const Point3& offset : object.offsets)
        part.instances.push_back({static_cast<std::uint32_t>(part.meshes.size()), offset});
      part.meshes.push_back(std::move(*mesh));
    }
  } else {
    std::optional<Mesh> sound;
    if (options.blocks && format == Format::kBinaryStl) {
      sound = read_sound_stl(*source, Snapper(options.transform, options.unit_mm), options, see, part.notes);
    }
    if (!sound) {
      Result<Facets> facets = read_facets(*source, format, options);
      if (!facets) return facets.error();
      Result<Mesh> mesh = finish(*source, path, "", std::move(*facets), options, part.notes);
      if (!mesh) return mesh.error();
      sound = std::move(*mesh);
    }
    part.meshes.push_back(std::move(*sound));
    part.instances.push_back({0, {0, 0, 0}});
  }
  if (const Status within = add_bounds(*source, part); !within) return within.error();
  if (const Status extent = check_extent(*source, part); !extent) return extent.error();
  if (format != Format::k3mf) hint_at_unit(part);
  return part;
}

/// Libraries and memory may throw; nothing leaves this stage that way.
template <class Work>
auto guarded(const std::string& path, const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::exception& problem) {
    if (is_shortage(problem)) return Error{Fault::kMemory, path + ": " + out_of_memory().message};
    return Error{Fault::kInternal, path + ": " + problem.what()};
  }
}

}  // namespace

bool Transform::mirrors() const {
  const auto& m = linear;
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]) < 0;
}

Transform make_transform(const std::array<double, 3>& scale, const std::array<double, 3>& rotate_deg,
                         const std::array<double, 3>& shrink) {
  std::array<double, 3> s{}, c{};
  for (std::size_t axis = 0; axis < 3; ++axis) sine_cosine(rotate_deg[axis], s[axis], c[axis]);
  const Matrix about_x{1, 0, 0, 0, c[0], -s[0], 0, s[0], c[0]};
  const Matrix about_y{c[1], 0, s[1], 0, 1, 0, -s[1], 0, c[1]};
  const Matrix about_z{c[2], -s[2], 0, s[2], c[2], 0, 0, 0, 1};
  const Matrix scaled{scale[0], 0, 0, 0, scale[1], 0, 0, 0, scale[2]};
  const Matrix shrunk{shrink[0], 0, 0, 0, shrink[1], 0, 0, 0, shrink[2]};
  Transform transform;
  transform.linear = multiply(shrunk, multiply(about_z, multiply(about_y, multiply(about_x, scaled))));
  return transform;
}

Result<Part> load(const std::string& path, const LoadOptions& options) { return load_and_see(path, options, {}); }

Result<Part> load_and_see(const std::string& path, const LoadOptions& options, const SeeTriangles& see) {
  return guarded(path, [&] { return load_unguarded(path, options, see); });
}

Result<std::string> format_of(const std::string& path, const LoadOptions& options) {
  return guarded(path, [&]() -> Result<std::string> {
    Format format{};
    bool was_gzip = false;
    const Result<Source> source = open_plain(path, options, format, was_gzip);
    if (!source) return source.error();
    const char* const name = format == Format::kBinaryStl  ? "binary STL"
                             : format == Format::kAsciiStl ? "ASCII STL"
                             : format == Format::kObj      ? "OBJ"
                                                           : "3MF";
    return std::string(name) + (was_gzip ? ", gzip" : "");
  });
}

bool is_part_name(std::string_view path) {
  std::string_view name = path.substr(path.rfind('/') + 1);
  while (ends_with(name, ".gz")) name.remove_suffix(3);
  return name.size() > 4 && (ends_with(name, ".stl") || ends_with(name, ".obj") || ends_with(name, ".3mf"));
}

std::uint64_t part_bytes(std::string_view path, std::uint64_t file_bytes) {
  if (ends_with(path, ".stl") || ends_with(path, ".obj")) return 4 * file_bytes;
  if (ends_with(path, ".3mf")) return 40 * file_bytes;
  return (ends_with(path, ".gz") ? 16 : 1) * file_bytes;
}

}  // namespace lamina::load
