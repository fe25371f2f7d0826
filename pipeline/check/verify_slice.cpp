#include "pipeline/check/verify_slice.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "stages/data/hash.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class SliceVerifier {
 public:
  explicit SliceVerifier(const std::string& directory) : directory_(directory) { report_.directory = directory; }

  Result<VerifyReport> run() {
    const std::string path = (directory_ / "manifest.json").string();
    std::ifstream manifest(path, std::ios::binary);
    std::string head, line;
    std::size_t number = 0;
    try {
      while (std::getline(manifest, line) && line != "  \"layers\": [") head += line + "\n", ++number;
      begin(json::parse(head + "\"layers\": []}"));
      for (++number; std::getline(manifest, line) && !line.starts_with("  ]");) {
        ++number;
        if (line.ends_with(',')) line.pop_back();
        layer(json::parse(line));
      }
      std::string rest = "{\"layers\": [\n" + line;
      while (std::getline(manifest, line)) rest += line;
      end(json::parse(rest));
    } catch (const json::exception& error) {
      return Error{Fault::kVerification,
                   fmt::format("{}: line {}: is not what lamina slice writes ({})", path, number + 1, error.what())};
    }
    return std::move(report_);
  }

 private:
  void fault(std::string text) {
    constexpr std::size_t kFaultsTold = 20;
    if (report_.faults.size() < kFaultsTold) report_.faults.push_back(std::move(text));
    ++report_.fault_count;
  }

  void begin(const json& head) {
    format_ = head.at("format");
    next_ = head.at("first_layer");
    last_ = head.at("last_layer");
    if (head.at("file").is_null()) return;
    name_ = head.at("file");
    std::error_code error;
    if (!fs::is_regular_file(directory_ / name_, error)) {
      fault(fmt::format("{}: is missing", name_));
    } else {
      size_ = fs::file_size(directory_ / name_, error);
      file_.open(directory_ / name_, std::ios::binary);
    }
  }

  /// Takes `bytes` from where the file stands.
  std::string piece(std::uint64_t bytes) {
    std::string text(std::min(bytes, size_), '\0');
    file_.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(file_.gcount()));
    return text;
  }

  void layer(const json& record) {
    ++report_.layers;
    const std::uint32_t index = record.at("layer");
    if (index != next_++) fault(fmt::format("manifest.json: layer {} where {} is next", index, next_ - 1));
    if (!record.contains("bytes")) return;  // the format keeps all layers in a package, or in no file
    const std::uint64_t bytes = record.at("bytes");
    Hash128 hash;
    if (!read_hex(record.at("xxh3_128").get<std::string>(), hash))
      fault(fmt::format("manifest.json: layer {}: no hash", index));
    report_.bytes += bytes;
    if (name_.empty()) return alone(index, bytes, hash);
    if (!file_.is_open()) return;
    const std::uint64_t offset = record.at("offset");
    if (report_.layers == 1) ends_ = piece(offset), at_ = offset;
    if (offset != at_) fault(fmt::format("{}: layer {} begins at byte {}, the manifest says {}", name_, index, at_, offset));
    at_ = offset + bytes;
    const std::string text = piece(bytes);
    if (text.size() != bytes) {
      fault(fmt::format("{}: ends within layer {}", name_, index));
    } else if (hash_bytes(std::as_bytes(std::span(text))) != hash) {
      fault(fmt::format("{}: layer {} is not what was written", name_, index));
    }
  }

  /// A layer in a file of its own.
  void alone(std::uint32_t index, std::uint64_t bytes, const Hash128& hash) {
    const std::string name = fmt::format("layers/{:06}{}", index, format_ == "svg" ? ".svg" : ".cli");
    ++files_;
    std::error_code error;
    if (!fs::is_regular_file(directory_ / name, error)) return fault(fmt::format("{}: is missing", name));
    const auto digest = digest_file((directory_ / name).string());
    if (!digest) return fault(digest.error().message);
    if (digest->bytes != bytes) return fault(fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, bytes));
    if (digest->hash != hash) fault(fmt::format("{}: its content is not what was written", name));
  }

  void end(const json& rest) {
    if (next_ != last_) fault(fmt::format("manifest.json: ends before layer {}, layers go to {}", next_, last_ - 1));
    if (files_ > 0) {
      std::uint64_t found = 0;
      std::error_code error;
      for (fs::directory_iterator entry(directory_ / "layers", error), stop; !error && entry != stop; entry.increment(error))
        ++found;
      if (found > files_) fault(fmt::format("layers: holds {} files that the manifest does not name", found - files_));
    }
    if (!file_.is_open()) return;
    if (rest.contains("file_xxh3_128")) {
      const auto digest = digest_file((directory_ / name_).string());
      if (!digest) return fault(digest.error().message);
      report_.bytes += digest->bytes;
      if (hex(digest->hash) != rest.at("file_xxh3_128")) fault(fmt::format("{}: its content is not what was written", name_));
      return;
    }
    const std::uint64_t total = rest.at("file_bytes");
    if (report_.layers == 0) at_ = 0;
    if (size_ != total) return fault(fmt::format("{}: {} bytes, the manifest says {}", name_, size_, total));
    ends_ += piece(total - at_);
    if (hex(hash_bytes(std::as_bytes(std::span(ends_)))) != rest.at("ends_xxh3_128")) {
      fault(fmt::format("{}: before its first or behind its last layer it is not what was written", name_));
    }
  }

  fs::path directory_;
  std::string format_, name_, ends_;
  std::ifstream file_;
  std::uint32_t next_ = 0, last_ = 0;
  std::uint64_t size_ = 0, at_ = 0, files_ = 0;
  VerifyReport report_;
};

}  // namespace

Result<VerifyReport> verify_slices(const std::string& directory) { return SliceVerifier(directory).run(); }

}  // namespace lamina::pipeline
