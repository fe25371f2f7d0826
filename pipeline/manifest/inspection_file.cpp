#include "pipeline/manifest/inspection_file.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <string_view>

#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"

namespace lamina {
namespace {

constexpr std::uint64_t kMaxBytes = 4 << 20;
constexpr std::array<std::string_view, 1> kMarks = {"\"kind\":\"inspection\""};

/// Of this job, or of any if head is null.
std::optional<Json> read_of(const std::string& directory, const ManifestHead* head) {
  const std::string path = inspection_path(directory);
  if (!is_file(path)) return std::nullopt;
  const auto text = read_file(path, {.max_bytes = kMaxBytes});
  if (!text || !json_nests_within(*text)) return std::nullopt;
  Json json;
  try {
    json = parse_json(*text);
  } catch (const JsonError&) {
    return std::nullopt;
  }
  const auto is = [&](const char* key, std::string_view value) {
    const Json* member = json.find(key);
    return member != nullptr && member->is_string() && member->text() == value;
  };
  if (!json.is_object() || !is("kind", "inspection")) return std::nullopt;
  if (head != nullptr && !is("job", hex(head->id()))) return std::nullopt;
  return json;
}

}  // namespace

std::string inspection_path(const std::string& directory) { return directory + "/inspection.json"; }

Status check_inspection_file(const std::string& directory) {
  const std::string path = inspection_path(directory);
  if (is_replaceable(path, kMarks)) return {};
  return Error{Fault::kUsage,
               fmt::format("{}: is there already, and lamina did not write it; remove it, leave out --inspect, or "
                           "name another output",
                           path)};
}

std::string inspection_text(const ManifestHead& head, const Json& facts) {
  Json json{{"lamina", head.version}, {"kind", "inspection"}, {"job", hex(head.id())}};
  json.update(facts);
  return json_line(json);
}

Status write_inspection(const std::string& directory, const ManifestHead& head, const Json& facts) {
  if (Status status = check_inspection_file(directory); !status) return status;
  const std::string text = inspection_text(head, facts);
  return write_file(inspection_path(directory), std::string_view(text));
}

Status keep_inspection_of(const std::string& directory, const ManifestHead& head) {
  if (!read_of(directory, nullptr) || read_of(directory, &head)) return {};
  std::error_code error;
  std::filesystem::remove(inspection_path(directory), error);
  return error ? Status(Error{Fault::kOutput, fmt::format("{}: {}", inspection_path(directory), error.message())}) : Status();
}

std::optional<Json> read_inspection(const std::string& directory, const ManifestHead& head) {
  return read_of(directory, &head);
}

}  // namespace lamina
