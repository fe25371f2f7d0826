// pipeline/watch/completeness.h: whether a part file is whole, by what its own format states about its end.
#pragma once

#include <atomic>
#include <string>

namespace lamina::pipeline {

/// The end of a part file.
struct FileEnd {
  enum class Content {
    kMissing,   // the file is incomplete
    kUnstated,  // nothing is missing, but the format states no length: OBJ, ASCII STL with endsolid, job files
    kStated     // the file has the length that it states: binary STL, 3MF, gzip
  };
  Content content = Content::kMissing;
  std::string missing;  // of an incomplete file: "5084 of 10084 bytes"
  bool unread = false;  // it could not be read: that may change while the file does not
};

/// Detects the format from the content first, then from the name, as load::load() does. A damaged file may be whole.
/// A file that cannot be read is incomplete, with the reason.
/// stop  ends the work; the file is then incomplete
/// cost  reads at most 66 KiB; a gzip file whole
FileEnd end_of_file(const std::string& path, const std::atomic<bool>& stop);

}  // namespace lamina::pipeline
