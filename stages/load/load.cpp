// stages/load/load.cpp: a file goes to the reader of its format, and its meshes are checked, closed and described.
#include "stages/load/load.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <optional>
#include <utility>

#include "stages/data/shortage.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/load/part_store.h"
#include "stages/load/repair/finish.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/stl_binary.h"
#include "stages/load/text.h"
#include "stages/load/text_formats.h"
#include "stages/load/threemf/threemf.h"

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

// --- names of formats that are not read, so that a refusal says what to do.

constexpr const char* kModeller = "; export the part from the CAD program as STL or 3MF";
constexpr const char* kMesh = "; convert it to STL, OBJ or 3MF, for example in Blender or MeshLab";
constexpr const char* kUnpack = "; unpack it and name the part in it";
constexpr const char* kWrongFile = "; name the part file itself";

struct Signature {
  std::string_view begin;
  const char* what;
  const char* remedy;
};

/// Bytes that no text and no header of a binary STL file begins with.
constexpr std::array<Signature, 18> kBytes{{
    {"\x89PNG", "is a PNG picture", kWrongFile},
    {"\xff\xd8\xff", "is a JPEG picture", kWrongFile},
    {"GIF8", "is a GIF picture", kWrongFile},
    {std::string_view("II*\0", 4), "is a TIFF picture", kWrongFile},
    {std::string_view("MM\0*", 4), "is a TIFF picture", kWrongFile},
    {"%PDF-", "is a PDF document", kModeller},
    {"\xd0\xcf\x11\xe0", "is a file of SolidWorks, Inventor or an old Office", kModeller},
    {"7z\xbc\xaf\x27\x1c", "is a 7z archive", kUnpack},
    {"Rar!\x1a\x07", "is a RAR archive", kUnpack},
    {"BZh", "is compressed by bzip2", kUnpack},
    {"\xfd"
     "7zXZ",
     "is compressed by xz", kUnpack},
    {"\x28\xb5\x2f\xfd", "is compressed by zstd", kUnpack},
    {"glTF", "is glTF, a scene", kMesh},
    {"Kaydara FBX Binary", "is FBX, a scene", kMesh},
    {"BLENDER", "is a Blender file", kMesh},
    {"3D Geometry File Format", "is a Rhino file", kModeller},
    {"\x7f"
     "ELF",
     "is a program", kWrongFile},
    {"SQLite format 3", "is a database", kWrongFile},
}};

/// Words that a text begins with, in lower case; behind them something else.
constexpr std::array<Signature, 16> kWords{{
    {"iso-10303-21", "is STEP, a CAD file of exact surfaces", kModeller},
    {"ply", "is PLY, a mesh", kMesh},
    {"off", "is OFF, a mesh", kMesh},
    {"coff", "is OFF, a mesh", kMesh},
    {"noff", "is OFF, a mesh", kMesh},
    {"stoff", "is OFF, a mesh", kMesh},
    {"#vrml", "is VRML, a scene", kMesh},
    {"#x3d", "is X3D, a scene", kMesh},
    {"#inventor", "is Open Inventor, a scene", kMesh},
    {"**abcdefghijklmnopqrstuvwxyz", "is Parasolid, a CAD file of exact surfaces", kModeller},
    {"dbrep_drawableshape", "is a BREP of Open Cascade, a CAD file of exact surfaces", kModeller},
    {"cascade", "is a BREP of Open Cascade, a CAD file of exact surfaces", kModeller},
    {"$$headerstart", "is CLI, layers that are sliced already", kModeller},
    {"solidworks", "is a SolidWorks file", kModeller},
    {"; fbx", "is FBX, a scene", kMesh},
    {"version https://git-lfs", "is a pointer of git-lfs in place of the file; fetch it with git lfs pull", ""},
}};

/// Elements that an XML document has at its top, in lower case.
constexpr std::array<Signature, 9> kElements{{
    {"amf", "is AMF, a mesh", kMesh},
    {"x3d", "is X3D, a scene", kMesh},
    {"collada", "is COLLADA, a scene", kMesh},
    {"html", "is a web page, perhaps in place of a download that failed; download the part again", ""},
    {"!doctype html", "is a web page, perhaps in place of a download that failed; download the part again", ""},
    {"svg", "is an SVG drawing", kModeller},
    {"model", "is the model of a 3MF file without its zip; name the whole .3mf", ""},
    {"vtkfile", "is VTK, a mesh", kMesh},
    {"mesh", "is a mesh in XML", kMesh},
}};

bool begins(std::string_view text, std::string_view lower_case) {
  return is_word(text.substr(0, lower_case.size()), lower_case);
}

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

std::string said(const Signature& signature) { return std::string(signature.what) + signature.remedy; }

std::string xml_format(std::string_view head) {
  for (std::size_t at = head.find('<'); at != head.npos; at = head.find('<', at + 1)) {
    const std::string_view element = head.substr(at + 1);
    for (const Signature& known : kElements) {
      if (!begins(element, known.begin)) continue;
      const std::size_t behind = known.begin.size();
      if (behind >= element.size() || is_blank(element[behind]) || element[behind] == '>' || element[behind] == '/')
        return said(known);
    }
  }
  return "is XML of an unknown kind; export the part as STL, OBJ or 3MF";
}

/// IGES has lines of 80 characters; column 73 of the first is S, and a number follows.
bool is_iges(std::string_view head) {
  if (head.size() < 80 || head[72] != 'S' || head.substr(0, 80).find('\n') != head.npos) return false;
  const std::string_view number = head.substr(73, 7);
  return std::all_of(number.begin(), number.end(), [](char c) { return c == ' ' || (c >= '0' && c <= '9'); }) &&
         number.find('1') != number.npos;
}

/// A DXF drawing: group codes and values line by line.
bool is_dxf(std::string_view head) {
  const std::size_t section = head.substr(0, 64).find("SECTION");
  return section != head.npos && head.substr(0, section).find_first_not_of(" 0\r\n") == head.npos;
}

/// The end of a sentence that begins with the file's name: the format and what to do about it; "" if it is of no known one.
std::string unsupported_format(std::string_view head) {
  if (begins(head, "\xff\xfe") || begins(head, "\xfe\xff"))
    return "is text in UTF-16, two bytes a character; save it as UTF-8 or ASCII";
  for (const Signature& known : kBytes)
    if (head.substr(0, known.begin.size()) == known.begin) return said(known);
  if (head.size() > 262 && head.substr(257, 5) == "ustar") return std::string("is a tar archive") + kUnpack;
  if (is_iges(head)) return std::string("is IGES, a CAD file of exact surfaces") + kModeller;
  if (begins(head, "\xef\xbb\xbf")) head.remove_prefix(3);
  while (!head.empty() && is_blank(head.front())) head.remove_prefix(1);
  for (const Signature& known : kWords) {
    if (!begins(head, known.begin)) continue;
    const std::size_t behind = known.begin.size();
    // "off" and "ply" have to be whole words.
    if (behind > 5 || behind == head.size() || is_blank(head[behind]) || head[0] == '#') return said(known);
  }
  if (is_dxf(head)) return std::string("is DXF, a drawing") + kModeller;
  if (begins(head, "<")) return xml_format(head);
  if (begins(head, "{") || begins(head, "[")) {
    if (head.find("\"asset\"") != head.npos) return std::string("is glTF, a scene") + kMesh;
    return "is JSON, perhaps in place of a download that failed; download or export the part again";
  }
  return {};
}

/// Refuses a file whose signature is that of a known format that lamina does not read.
/// head    its first bytes, at least 512 where the file has them
/// errors  kInput: the format, and what to do about it
Status refuse_unsupported(const Source& source, std::string_view head) {
  const std::string format = unsupported_format(head);
  return format.empty() ? Status() : source.error(format);
}

/// Whether text is probably the program of a machine, which has no signature.
bool is_machine_program(std::string_view head) {
  int commands = 0, others = 0;
  for (std::size_t at = 0; at < head.size();) {
    const std::size_t end = std::min(head.find_first_of("\r\n", at), head.size());
    std::string_view line = head.substr(at, end - at);
    at = end + 1;
    if (at > head.size()) break;  // the last line may be cut
    while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
    if (line.empty() || line.front() == ';' || line.front() == '%' || line.front() == '(') continue;
    const char first = static_cast<char>(line.front() | 0x20);  // in lower case
    const bool is_command =
        (first == 'g' || first == 'm' || first == 't' || first == 'n') && line.size() > 1 && line[1] >= '0' && line[1] <= '9';
    ++(is_command ? commands : others);
  }
  return commands > 0 && commands >= 4 * others;
}

enum class Format { kBinaryStl, kAsciiStl, kObj, k3mf, kGzip };

constexpr std::size_t kHead = 4096;

bool ends_with(std::string_view path, std::string_view lower_case) {
  return path.size() >= lower_case.size() && is_word(path.substr(path.size() - lower_case.size()), lower_case);
}

/// Binary STL has zero bytes in its first facets; text, in any encoding, has none (but for padding at its end),
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

/// The size that a binary STL file's own count implies, of either byte order. In text, the count's bytes are characters and
/// imply more than 7 GB, so the test decides regardless of the header.
bool has_binary_stl_size(const Source& source, std::string_view head) {
  if (head.size() < 84) return false;
  std::uint64_t count = 0, swapped = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    count = count << 8 | static_cast<unsigned char>(head[83 - i]);
    swapped = swapped << 8 | static_cast<unsigned char>(head[80 + i]);
  }
  return source.size() == 84 + 50 * count || (swapped > 0 && source.size() == 84 + 50 * swapped);
}

/// Whether facets of text STL are there, however the name of the solid is padded: "facet normal", in any case.
bool has_text_facet(std::string_view head) {
  for (std::size_t at = 0, end = 0; at < head.size(); at = end + 1) {
    end = at;
    while (end < head.size() && !is_space(head[end])) ++end;
    if (!is_word(head.substr(at, end - at), "facet")) continue;
    while (end < head.size() && is_space(head[end])) ++end;
    if (is_word(head.substr(end, 6), "normal")) return true;
    --end;
  }
  return false;
}

/// The first bytes of a file; where most of them are blank, those from its first byte on that is not.
std::string_view head_behind_blanks(const Source& source, std::array<char, kHead>& bytes) {
  std::string_view head = source.head(bytes);
  for (std::uint64_t offset = 0; head.size() == kHead;) {
    const auto blanks = static_cast<std::uint64_t>(std::find_if_not(head.begin(), head.end(), is_blank) - head.begin());
    if (blanks == 0 || (blanks < kHead / 2 && offset == 0) || offset + blanks == source.size()) break;
    offset += blanks;
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kHead, source.size() - offset));
    head = source.read(offset, bytes.data(), count) ? std::string_view(bytes.data(), count) : std::string_view();
  }
  return head;
}

/// Detects the format from the content, and from the name where the content is text that could be anything.
/// errors  kInput: empty, or nothing that is known
Result<Format> detect(const Source& source) {
  if (source.size() == 0) return source.error("is empty; export the part again");
  std::array<char, kHead> bytes;
  std::string_view head = head_behind_blanks(source, bytes);
  if (head.empty()) return source.changed_while_read();
  if (head.substr(0, 4) == "PK\x03\x04" || head.substr(0, 4) == std::string_view("PK\x05\x06", 4)) return Format::k3mf;
  if (head.substr(0, 2) == "\x1f\x8b") return Format::kGzip;
  if (has_binary_stl_size(source, head)) return Format::kBinaryStl;
  if (const Status known = refuse_unsupported(source, head); !known) return known.error();
  if (head.substr(0, 3) == "\xef\xbb\xbf") head.remove_prefix(3);
  std::string_view name = source.path();
  if (ends_with(name, ".gz")) name.remove_suffix(3);
  if (has_text_facet(head) && !ends_with(name, ".obj")) return Format::kAsciiStl;
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

/// The inflated bytes of an opened file; from the store, if it has them.
Result<Source> inflated(const Source& source, const LoadOptions& options) {
  const std::string path(source.path()), key = fmt::format("gzip {} {}", options.expanded_limit, path);
  const std::optional<FileStamp> stamp = options.store ? source.stamp() : std::nullopt;
  if (stamp) {
    if (auto known = options.store->find<Buffer<char>>(key, *stamp)) return Source::of_memory(path, std::move(known));
  }
  Result<Source> plain = inflate_gzip(source, options.expanded_limit);
  if (plain && stamp) options.store->add(key, path, *stamp, plain->memory(), bytes_held(*plain->memory()));
  return plain;
}

/// Opens a file and inflates it if need be.
Result<Source> open_plain(const std::string& path, const LoadOptions& options, Format& format, bool& was_gzip) {
  Result<Source> source = Source::open(path);
  if (!source) return source;
  Result<Format> found = detect(*source);
  if (!found) return found.error();
  was_gzip = *found == Format::kGzip;
  if (was_gzip) {
    source = inflated(*source, options);
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
Status check_extent(const Source& source, const Part& part, bool sound) {
  const bool any_area = sound || std::any_of(part.meshes.begin(), part.meshes.end(), [](const Mesh& mesh) {
                          return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), has_area);
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
  bool was_gzip = false, sound = false;  // sound: it encloses something
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
    std::optional<Mesh> only;
    if (options.blocks && format == Format::kBinaryStl)
      only = read_sound_stl(*source, Snapper(options.transform, options.unit_mm), options, see, part.notes);
    sound = only.has_value();
    if (!only) {
      Result<Facets> facets = read_facets(*source, format, options);
      if (!facets) return facets.error();
      Result<Mesh> mesh = finish(*source, path, "", std::move(*facets), options, part.notes);
      if (!mesh) return mesh.error();
      only = std::move(*mesh);
    }
    part.meshes.push_back(std::move(*only));
    part.instances.push_back({0, {0, 0, 0}});
  }
  if (const Status within = add_bounds(*source, part); !within) return within.error();
  if (const Status extent = check_extent(*source, part, sound); !extent) return extent.error();
  if (format != Format::k3mf) hint_at_unit(part);
  return part;
}

/// The file's name and all options that decide its meshes. A new option has to be listed here.
std::string key_of(const std::string& path, const LoadOptions& options) {
  const auto& [transform, unit_mm, drop_bad, repair, blocks, shown_only, order, isa, scratch, turn_shells, winding, weld_nm,
               triangle_limit, expanded_limit, store] = options;
  std::string key = fmt::format("part {} {}{}{}{}{}{}{} {} {} {}", unit_mm, drop_bad, repair, blocks, shown_only, order,
                                turn_shells, winding, weld_nm, triangle_limit, expanded_limit);
  for (const double value : transform.linear) key += fmt::format(" {}", value);
  for (const double value : transform.translation) key += fmt::format(" {}", value);
  return key + " " + path;
}

std::uint64_t bytes_of(const Part& part) {
  std::uint64_t bytes = sizeof(Part) + part.instances.size() * sizeof(Instance);
  for (const Mesh& mesh : part.meshes) {
    bytes += sizeof(Mesh) + mesh.triangles.size() * sizeof(Triangle);
    if (mesh.blocks) bytes += mesh.blocks->bytes() + mesh.blocks->bounds_bytes();
  }
  return bytes;
}

/// Takes a part from the store, or reads it and may add it.
Result<Part> load_from_store(const std::string& path, const LoadOptions& options) {
  const std::optional<FileStamp> stamp = file_stamp(path);
  if (!stamp) return load_unguarded(path, options, {});
  const std::string key = key_of(path, options);
  if (const auto known = options.store->find<Part>(key, *stamp)) return *known;
  Result<Part> part = load_unguarded(path, options, {});
  if (part && options.store->wants(key, path))
    options.store->add(key, path, *stamp, std::make_shared<const Part>(*part), bytes_of(*part));
  return part;
}

/// Libraries and memory may throw; nothing leaves this stage that way.
template <class Work>
auto guarded(const std::string& path, const Work& work) -> decltype(work()) {
  try {
    return report_shortages(path, work);
  } catch (const std::exception& problem) {
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

Result<Part> load(const std::string& path, const LoadOptions& options, const SeeTriangles& see) {
  return guarded(path,
                 [&] { return options.store && !see ? load_from_store(path, options) : load_unguarded(path, options, see); });
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
