#include "stages/load/threemf/archive.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/load/text.h"
#include "stages/load/threemf/model.h"
#include "stages/support/late/zip.h"
#include "stages/support/text/escape.h"

namespace lamina::load {
namespace {

struct CloseEntry {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

struct SourceOfZip {
  const Source* source;
  std::uint64_t position = 0;
};

zip_int64_t read_source(SourceOfZip& from, void* data, zip_uint64_t count) {
  const std::uint64_t maximum = std::min<std::uint64_t>(count, from.source->size() - from.position);
  if (!from.source->read(from.position, static_cast<char*>(data), static_cast<std::size_t>(maximum))) return -1;
  from.position += maximum;
  return static_cast<zip_int64_t>(maximum);
}

/// libzip reads from a Source, on disk or in memory, by these commands.
zip_int64_t serve_zip(void* user, void* data, zip_uint64_t count, zip_source_cmd_t command) {
  auto& from = *static_cast<SourceOfZip*>(user);
  switch (command) {
    case ZIP_SOURCE_OPEN: from.position = 0; return 0;
    case ZIP_SOURCE_CLOSE: return 0;
    case ZIP_SOURCE_READ: return read_source(from, data, count);
    case ZIP_SOURCE_TELL: return static_cast<zip_int64_t>(from.position);
    case ZIP_SOURCE_SEEK: {
      zip_error_t error;
      zip_error_init(&error);
      const zip_int64_t position = zip_source_seek_compute_offset(from.position, from.source->size(), data, count, &error);
      zip_error_fini(&error);
      if (position >= 0) from.position = static_cast<std::uint64_t>(position);
      return position < 0 ? -1 : 0;
    }
    case ZIP_SOURCE_STAT: {
      auto* const stat = static_cast<zip_stat_t*>(data);
      zip_stat_init(stat);
      stat->valid = ZIP_STAT_SIZE;
      stat->size = from.source->size();
      return sizeof(zip_stat_t);
    }
    case ZIP_SOURCE_ERROR: {
      const int codes[2] = {ZIP_ER_READ, 0};
      std::copy(std::begin(codes), std::end(codes), static_cast<int*>(data));
      return sizeof codes;
    }
    case ZIP_SOURCE_FREE: delete static_cast<SourceOfZip*>(user); return 0;
    case ZIP_SOURCE_SUPPORTS:
      return zip_source_make_command_bitmap(ZIP_SOURCE_OPEN, ZIP_SOURCE_READ, ZIP_SOURCE_CLOSE, ZIP_SOURCE_STAT,
                                            ZIP_SOURCE_ERROR, ZIP_SOURCE_FREE, ZIP_SOURCE_SEEK, ZIP_SOURCE_TELL,
                                            ZIP_SOURCE_SUPPORTS, -1);
    default: return -1;
  }
}

}  // namespace

void Archive::Discard::operator()(zip* archive) const { zip_discard(archive); }

Result<Archive> Archive::open(const Source& source, const LoadOptions& options) {
  if (const Status loaded = load_zip(); !loaded) return loaded.error();
  Archive archive(source, options);
  zip_error_t why;
  zip_error_init(&why);
  auto user = std::make_unique<SourceOfZip>(SourceOfZip{&source});
  zip_source_t* const from = zip_source_function_create(serve_zip, user.get(), &why);
  if (from != nullptr) {
    static_cast<void>(user.release());  // freed by ZIP_SOURCE_FREE
    archive.archive_.reset(zip_open_from_source(from, ZIP_RDONLY, &why));
    if (archive.archive_ == nullptr) zip_source_free(from);
  }
  const std::string text = archive.archive_ == nullptr ? zip_error_strerror(&why) : "";
  zip_error_fini(&why);
  if (archive.archive_ == nullptr)
    return source.error(fmt::format("is not a whole zip file ({}); copy or export it again", text));
  if (const Status listed = archive.list(); !listed) return listed.error();
  return archive;
}

Status Archive::check_sizes(std::uint64_t packed, std::uint64_t expanded, std::uint64_t total) const {
  if (total > limit_) return source_->error(fmt::format("expands to more than the limit of {} bytes", limit_));
  if (expansion_is_absurd(packed, expanded) || expansion_is_absurd(source_->size(), total))
    return source_->error("expands more than 200-fold, as no part does; unzip it to see what it is");
  return {};
}

Status Archive::list() {
  const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t entry;
    zip_stat_init(&entry);
    const zip_uint64_t needed = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE;
    if (zip_stat_index(archive_.get(), static_cast<zip_uint64_t>(i), 0, &entry) != 0 || (entry.valid & needed) != needed)
      return source_->error(fmt::format("zip entry {} is damaged; copy or export the file again", i + 1));
    const std::string_view name = entry.name;
    if (name.ends_with('/') || name.ends_with('\\')) continue;
    const bool encrypted = (entry.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && entry.encryption_method != ZIP_EM_NONE;
    const PackedFile file{static_cast<std::uint64_t>(i), entry.comp_size, entry.size, encrypted, std::string(name)};
    if (!entries_.emplace(part_name(name), file).second)
      return source_->error(fmt::format("holds two entries of the name {}; export it again", quoted(name)));
  }
  return {};
}

std::map<std::string, std::string> Archive::names() const {
  std::map<std::string, std::string> names;
  for (const auto& [key, file] : entries_) names.emplace(key, file.name);
  return names;
}

Status Archive::read(const std::string& name, const std::function<Status(std::string_view)>& take) {
  const PackedFile& entry = entries_.at(name);
  const auto damaged = [&](const char* why) {
    return source_->error(fmt::format("zip entry {} is damaged ({}); copy or export the file again", entry.index + 1, why));
  };
  if (entry.encrypted) return source_->error("is encrypted; save it without a password");
  const std::uint64_t total = inflated_ + std::min(entry.expanded, UINT64_MAX - inflated_);
  if (const Status fits = check_sizes(entry.packed, entry.expanded, total); !fits) return fits;
  const std::unique_ptr<zip_file_t, CloseEntry> file(zip_fopen_index(archive_.get(), entry.index, 0));
  if (file == nullptr) return damaged(zip_strerror(archive_.get()));
  Buffer<char> block(std::size_t{64} << 10);
  std::uint64_t expanded = 0;
  while (true) {
    const zip_int64_t got = zip_fread(file.get(), block.data(), block.size());
    if (got < 0) return damaged(zip_file_strerror(file.get()));
    if (got == 0) return {};
    expanded += static_cast<std::uint64_t>(got);
    inflated_ += static_cast<std::uint64_t>(got);
    if (const Status fits = check_sizes(entry.packed, expanded, inflated_); !fits) return fits;
    if (const Status taken = take({block.data(), static_cast<std::size_t>(got)}); !taken) return taken;
  }
}

Status Archive::read_xml(const std::string& name, XmlReader& reader) {
  const auto faulty = [&] { return source_->error(fmt::format("{}, {}", name.substr(1), reader.fault())); };
  const Status fed = read(name, [&](std::string_view bytes) { return reader.feed(bytes) ? Status() : faulty(); });
  return !fed || reader.finish() ? fed : faulty();
}

// --- what leads from a package to its model.

namespace {

constexpr std::string_view kModelRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
constexpr std::string_view kPrintTicketRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/printticket";
constexpr std::string_view kTextureRelationship = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture";
constexpr std::string_view kThumbnailRelationship =
    "http://schemas.openxmlformats.org/package/2006/relationships/metadata/thumbnail";

struct Relationship {
  std::string type, target;
  bool external = false;
};

class RelationshipHandler : public XmlHandler {
 public:
  std::vector<Relationship> relationships;

  void start(const XmlName& name, XmlAttributes attributes) override {
    if (name.local != "Relationship") return;
    Relationship& one = relationships.emplace_back();
    for (; *attributes != nullptr; attributes += 2) {
      const std::string_view attribute = attributes[0], value = attributes[1];
      if (attribute == "Type") one.type = value;
      if (attribute == "Target") one.target = value;
      if (attribute == "TargetMode") one.external = value == "External";
    }
  }
  void end() override {}
};

Result<std::vector<Relationship>> read_relationships(Archive& archive, const std::string& part) {
  RelationshipHandler handler;
  XmlReader reader(handler);
  if (const Status read = archive.read_xml(part, reader); !read) return read.error();
  return std::move(handler.relationships);
}

/// "/3d/_rels/3dmodel.model.rels" of "/3d/3dmodel.model"
std::string relationships_of(const std::string& part) {
  const std::size_t slash = part.rfind('/') + 1;
  return part.substr(0, slash) + "_rels/" + part.substr(slash) + ".rels";
}

/// Whether a target is a whole address, which nothing within a package has.
bool leads_out(const Relationship& one) {
  const std::size_t colon = one.target.find(':');
  return one.external || (colon != 0 && colon < one.target.find_first_of("/?#"));
}

/// What a model consists of has to be in the package (core 2.1.1). Links to anything else are not for lamina.
Status check_inside(const Source& source, std::string_view part, const Relationship& one) {
  const bool of_payload = one.type == kModelRelationship || one.type == kPrintTicketRelationship ||
                          one.type == kThumbnailRelationship || one.type == kTextureRelationship;
  if (!of_payload || !leads_out(one)) return {};
  return source.error(fmt::format("{} names {}, which lies outside of the file; 3MF forbids this (core 2.1.1): export it again",
                                  part.substr(1), quoted(std::string_view(one.target))));
}

/// A second print ticket makes a file invalid; its requests are not for lamina.
Status check_model_relationships(const Source& source, Archive& archive, const std::string& model) {
  const std::string part = relationships_of(model);
  if (!archive.has(part)) return {};
  const auto relationships = read_relationships(archive, part);
  if (!relationships) return relationships.error();
  std::size_t tickets = 0;
  for (const Relationship& one : *relationships) {
    if (const Status inside = check_inside(source, part, one); !inside) return inside;
    tickets += one.type == kPrintTicketRelationship ? 1 : 0;
  }
  if (tickets > 1) return source.error("has more than one print ticket, which 3MF forbids; export it again");
  return {};
}

}  // namespace

Result<std::string> find_start_part(const Source& source, Archive& archive, ModelPackage& package) {
  const std::string root = "/_rels/.rels";
  if (!archive.has(root)) return source.error("is a zip file, but no 3MF: it has no _rels/.rels; unzip it, or export it again");
  const auto relationships = read_relationships(archive, root);
  if (!relationships) return relationships.error();
  std::string model;
  for (const Relationship& one : *relationships) {
    const bool is_model = one.type == kModelRelationship;
    if (const Status inside = check_inside(source, root, one); !inside) return inside.error();
    const std::string target = part_name(one.target);
    if (one.type == kThumbnailRelationship && !archive.has(target))
      package.depart("a thumbnail that is named and not contained (core 2.1.3)", one.target);
    if (is_model && !archive.has(target))
      return source.error(fmt::format("_rels/.rels names {}, which the file does not contain; export it again",
                                      quoted(std::string_view(one.target))));
    if (is_model && !model.empty())
      return source.error("names more than one 3D model to start from, which 3MF forbids; export it again");
    if (is_model) model = target;
  }
  if (model.empty()) return source.error("is a zip file, but no 3MF: it names no 3D model; unzip it, or export it again");
  if (const Status known = check_model_relationships(source, archive, model); !known) return known.error();
  return model;
}

}  // namespace lamina::load
