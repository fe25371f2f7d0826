#include "pipeline/manifest/layer_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <tuple>

#include "stages/formats/image_format.h"
#include "stages/program/dialect.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/io/paged.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/number_text.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

bool take_end(std::string_view& text, std::string_view end) {
  if (!text.ends_with(end)) return false;
  text.remove_suffix(end.size());
  return true;
}

/// The same for the ending of a temporary file.
bool take_temporary_end(std::string_view& name) {
  const std::string_view named = named_by_temporary(name);
  if (named.empty()) return take_end(name, ".part");
  name = named;
  return true;
}

bool is_manifest(std::string_view name, ManifestFile& file) {
  file = {};
  file.name = name;
  file.partial = take_end(name, ".part");
  if (name == "manifest.json") return true;
  if (!name.starts_with("manifest-") || !take_end(name, ".json")) return false;
  name.remove_prefix(std::string_view("manifest-").size());
  const std::size_t of = name.find("-of-");
  if (of == std::string_view::npos) return false;
  std::array<std::uint32_t, 2> shard{};
  if (!read_shard(fmt::format("{}/{}", name.substr(0, of), name.substr(of + 4)), shard).empty()) return false;
  file.shard = shard;
  return true;
}

template <class Visit>
void for_each_entry(const fs::path& directory, Visit visit) {
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) visit(*entry);
}

/// Whether a name is that stem with the end of a dialect's files.
bool is_program_file(std::string_view stem, std::string_view name, const program::Dialect& dialect) {
  if (!name.starts_with(stem)) return false;
  name.remove_prefix(stem.size());
  if (dialect.compressed() && is_compressed(name)) name.remove_suffix(kCompressedEnd.size());
  return name == dialect.extension;
}

bool is_program_frame(std::string_view name) {
  return name == "machine.toml" || std::ranges::any_of(program::dialects(), [&](const program::Dialect& one) {
           return is_program_file("start", name, one) || is_program_file("end", name, one);
         });
}

// The other files in program/, of any dialect, and their temporary ones.
std::vector<fs::path> program_frames(const std::string& directory) {
  std::vector<fs::path> found;
  for_each_entry(fs::path(directory) / "program", [&](const fs::directory_entry& entry) {
    const std::string file = entry.path().filename().string();
    const std::string_view named = named_by_temporary(file);
    if (is_program_frame(named.empty() ? file : named)) found.push_back(entry.path());
  });
  return found;
}

}  // namespace

bool lies_in_job(const std::string& file, const std::string& directory) {
  std::error_code error;
  const auto position = [&](const std::string& name) { return fs::weakly_canonical(fs::absolute(name, error), error); };
  const fs::path inside = position(file).lexically_relative(position(directory));
  if (inside.empty()) return false;
  const fs::path& first = *inside.begin();
  ManifestFile manifest;
  return first == "layers" || first == "program" || first == kPagesFile || is_manifest(inside.string(), manifest);
}

std::vector<ManifestFile> find_manifests(const std::string& directory) {
  std::vector<ManifestFile> found;
  for (const std::string& name : names_in_folder(directory)) {
    ManifestFile file;
    if (is_manifest(name, file)) found.push_back(std::move(file));
  }
  constexpr std::array<std::uint32_t, 2> kWhole{};
  std::sort(found.begin(), found.end(), [&](const ManifestFile& a, const ManifestFile& b) {
    const auto [a_index, a_count] = a.shard.value_or(kWhole);
    const auto [b_index, b_count] = b.shard.value_or(kWhole);
    return std::tie(a_count, a_index, a.partial) < std::tie(b_count, b_index, b.partial);
  });
  return found;
}

std::vector<fs::path> layer_files(const std::string& directory) {
  std::vector<fs::path> found;
  for_each_entry(fs::path(directory) / "program", [&](const fs::directory_entry& entry) {
    std::uint32_t index = 0;
    bool partial = false;
    if (read_program_file_name(entry.path().filename().string(), index, partial)) found.push_back(entry.path());
  });
  for_each_entry(fs::path(directory) / "layers", [&](const fs::directory_entry& entry) {
    std::uint32_t index = 0;
    bool partial = false;
    if (read_layer_file_name(entry.path().filename().string(), index, partial)) found.push_back(entry.path());
  });
  return found;
}

bool take_layer_index(std::string_view& name, std::uint32_t& index) {
  const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  const auto digits = static_cast<std::size_t>(stop - name.data());
  if (error != std::errc() || digits < 6 || (digits > 6 && name.front() == '0')) return false;
  name.remove_prefix(digits);
  return true;
}

bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial) {
  partial = take_temporary_end(name);
  std::string_view& extension = name;
  if (!take_layer_index(name, index)) return false;
  if (extension.starts_with('-')) extension.remove_prefix(std::min(extension.find('.'), extension.size()));  // a material
  return std::ranges::any_of(formats::image_formats(), [&](const formats::ImageFormat& format) {
    return !extension.empty() && extension == format.extension;
  });
}

bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial) {
  partial = take_temporary_end(name);
  return take_layer_index(name, index) &&
         std::ranges::any_of(program::dialects(), [&](const program::Dialect& one) { return is_program_file("", name, one); });
}

bool is_job_file_name(const fs::path& name) {
  const std::string file = name.filename().string();
  std::uint32_t index = 0;
  bool partial = false;
  if (name.parent_path() == "layers") return read_layer_file_name(file, index, partial);
  return is_program_frame(file) || read_program_file_name(file, index, partial);
}

bool holds_layers(const std::string& directory) {
  return !layer_files(directory).empty() || !program_frames(directory).empty() || !pages_path(directory).empty();
}

Status check_stays_inside(const std::string& directory) {
  for (const char* name : {"layers", "program"}) {
    const fs::path position = fs::path(directory) / name;
    std::error_code error;
    if (!fs::is_symlink(position, error)) continue;
    const fs::path target = fs::weakly_canonical(position, error), inside = fs::weakly_canonical(directory, error);
    const fs::path near = target.lexically_relative(inside);
    if (!near.empty() && *near.begin() != "..") continue;
    return Error{Fault::kOutput, fmt::format("{}: is a link that leads out of {}; remove it", position.string(), directory)};
  }
  return {};
}

Status remove_layers(const std::string& directory) {
  std::error_code error;
  std::vector<fs::path> old = layer_files(directory);
  for (fs::path& file : program_frames(directory)) old.push_back(std::move(file));
  for (const std::string& file : paged_job_files(directory)) old.emplace_back(file);
  for (const fs::path& file : old) {
    fs::remove(file, error);
    if (error) return Error{Fault::kOutput, fmt::format("{}: {}", file.string(), error.message())};
  }
  return {};
}

void sweep_partial_files(const std::string& directory, std::uint32_t first, std::uint32_t last) {
  for (const fs::path& file : layer_files(directory)) {
    std::uint32_t index = 0;
    bool partial = false;
    if (!read_layer_file_name(file.filename().string(), index, partial)) {
      read_program_file_name(file.filename().string(), index, partial);
    }
    if (partial && index >= first && index < last) remove_or_note(file.string());
  }
  for (const fs::path& file : program_frames(directory)) {
    // Another shard may be writing its own right now.
    const bool whole = first == 0 && last == UINT32_MAX;
    if (whole && !named_by_temporary(file.filename().string()).empty()) remove_or_note(file.string());
  }
}

}  // namespace lamina
