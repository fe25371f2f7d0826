// stages/load/threemf/archive.h: the entries of a ZIP file, inflated piece by piece, and which of them is the model; internal
// to load.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/load/load.h"
#include "stages/load/source.h"
#include "stages/load/threemf/xml.h"

struct zip;

namespace lamina::load {

struct ModelPackage;

class Archive {
 public:
  /// source  has to outlive the archive
  /// errors  kInput: not a ZIP file, cut short, two entries of one name
  static Result<Archive> open(const Source& source, const LoadOptions& options);

  bool has(const std::string& name) const { return entries_.count(name) > 0; }

  /// The names of all entries, as part_name() gives them and as they are in the archive.
  std::map<std::string, std::string> names() const;

  /// Gives an entry's bytes to `take` in pieces of 64 KiB. All that was inflated so far and what the entry says of its size are
  /// bounded by options.expanded_limit and expansion_is_absurd(). Entries that are not read may be of any size and kind.
  ///
  /// name    as part_name() gives it; has to be there
  /// errors  those of `take`; kInput: damaged, encrypted, too large
  Status read(const std::string& name, const std::function<Status(std::string_view)>& take);
  /// Gives an entry to a reader. errors  kInput: damaged, too large, or what the reader refuses
  Status read_xml(const std::string& name, XmlReader& reader);

 private:
  struct PackedFile {
    std::uint64_t index, packed, expanded;
    bool encrypted;
    std::string name;
  };
  struct Discard {
    void operator()(zip* archive) const;
  };
  Archive(const Source& source, const LoadOptions& options) : source_(&source), limit_(options.expanded_limit) {}
  Status list();
  Status check_sizes(std::uint64_t packed, std::uint64_t expanded, std::uint64_t total) const;

  const Source* source_;
  std::uint64_t limit_;
  std::unique_ptr<zip, Discard> archive_;
  std::map<std::string, PackedFile> entries_;
  std::uint64_t inflated_ = 0;
};

/// The one part of a package that is its model, as part_name() gives it.
///
/// package  receives thumbnails that are not there as departures
/// errors  kInput: no relationships, none or more than one to a 3D model, one that leads out of the package or to nothing, more
///         than one print ticket
/// source  3MF Consortium, Core Specification 1.3, section 2.1
Result<std::string> find_start_part(const Source& source, Archive& archive, ModelPackage& package);

}  // namespace lamina::load
