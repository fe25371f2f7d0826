// stages/load/threemf/model.h: what lamina takes from the models of a 3MF package; internal to load.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/load/load.h"

namespace lamina::load {

/// What the program that wrote a file does with a volume.
enum class Role : std::uint8_t {
  kPart,
  kModifier,  // says how others are printed, or supported, and is no solid itself
  kNegative   // takes material away
};

/// Consecutive triangles of an object that a program treats as one.
struct Volume {
  std::uint64_t first = 0, last = 0;
  Role role = Role::kPart;
  std::string name;
};

/// A build item or a component: an object, and what happens to it. Its transform is in mm.
struct ObjectReference {
  std::uint32_t file;    // index in ModelPackage::files, where the object is
  std::uint64_t id;      // as the file counts
  std::uint32_t object;  // index in ModelPackage::objects, once all are known
  Transform transform;
  std::uint64_t line;  // where it stands, for errors
  Role role = Role::kPart;
  bool printable = true;
};

struct ModelObject {
  enum class Type { kModel, kSupport, kSurface, kOther };  // kSupport: both kinds of supports
  std::uint32_t file = 0;
  std::uint64_t id = 0;
  std::string name;
  Type type = Type::kModel;
  Buffer<std::array<double, 3>> vertices;  // in the file's unit
  Buffer<std::array<std::uint32_t, 3>> triangles;
  std::vector<ObjectReference> components;
  std::vector<Volume> volumes;  // those that are no parts
  Role role = Role::kPart;
  std::uint64_t beams = 0;      // of a lattice, which lamina does not plan
  bool sliced = false;          // slices say what it is, too
  bool low_resolution = false;  // slices alone say what it is
  std::string content;          // namespace of what it consists of, where that is no mesh and no components
};

struct ModelFile {
  std::string name;  // as part_name() gives it
  double unit_mm = 1;
};

/// Where a file does not follow the specification and its geometry is what it is all the same.
struct Departure {
  std::string rule;   // with the section
  std::string first;  // that departs
  std::uint64_t count = 0;
};

struct ModelPackage {
  std::vector<ModelFile> files;  // the first one is where the build is
  std::vector<ModelObject> objects;
  std::map<std::pair<std::uint32_t, std::uint64_t>, std::uint32_t> object_of_id;  // (file, id)
  std::vector<ObjectReference> items;                                             // of the build
  std::uint64_t triangles = 0;                                                    // of all objects, once each
  std::map<std::string, std::uint32_t> file_of_name;                              // index in files
  std::set<std::string> extensions;   // namespaces of elements that were passed over, where these may be geometry
  std::set<std::string> unsupported;  // namespaces of attributes that were passed over
  std::vector<Departure> departures;
  bool needs_beams = false;             // the package requires the extension to be understood
  bool has_forward_references = false;  // a component stands before the object that it names

  /// Adds to the departures from a rule.
  void depart(std::string_view rule, std::string_view what) {
    auto at = std::ranges::find(departures, rule, &Departure::rule);
    if (at == departures.end()) at = departures.insert(at, {std::string(rule), std::string(what), 0});
    ++at->count;
  }
  /// The index of a file, which is added if it is new.
  std::uint32_t file_of(const std::string& name) {
    const auto [found, is_new] = file_of_name.emplace(name, static_cast<std::uint32_t>(files.size()));
    if (is_new) files.push_back({name, 1});
    return found->second;
  }
};

}  // namespace lamina::load
