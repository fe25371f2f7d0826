// stages/support/io/container.h: reads the files of a job that are in one ZIP file.
//
// A path may lead through a container: out.zip/layers/000042.tif is the entry layers/000042.tif of the file out.zip. Entries
// are stored as they are, without compression. An unfinished container, out.zip.part, has no directory of entries yet: its
// entries are those that are whole. source  PKWARE, APPNOTE.TXT 6.3.10, sections 4.3 and 4.5.3
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

struct ContainerEntry {
  std::string name;  // with its folders, as in layers/000042.tif
  std::uint32_t crc = 0;
  std::uint64_t bytes = 0, header = 0;  // header: its offset in the file
};

/// The files of a container, in its order, without folders; of NAME.part those that are whole, from the first on.
/// end     unless null: the offset behind the last whole entry
/// errors  kVerification: cannot be read, no ZIP file, damaged, entries that are compressed, overlap or have the same name
/// cost    a few reads of the directory; of NAME.part two for each entry
Result<std::vector<ContainerEntry>> read_entries(const std::string& path, std::uint64_t* end = nullptr);

/// Whether a regular file begins like a container, and has the manifest of a job or is unfinished.
bool is_container(const std::string& path);

/// Whether a regular file begins like the container of a job, whole or not.
bool begins_like_job(const std::string& path);

/// Whether a directory or a container is there.
bool is_job_folder(const std::string& path);

/// The names of entries that are in no folder of a job, but below one or outside of all: "layers/a/b", "../a". Unpackers may
/// write them anywhere.
std::vector<std::string> misplaced_entries(const std::string& container);

/// The bytes of an entry in its container.
struct OpenedEntry {
  int file = -1;  // of the container, owned by the caller; -1: none
  std::uint64_t offset = 0, bytes = 0;
  std::string fault;  // of the container; "": errno states why there is no descriptor, ENOENT for no such entry
};
/// Opens manifests, inspection.json, and what is in layers/ or program/; other entries are no files of a job. Also of a file in
/// the pages of a job (paged.h).
/// cost  the entries are read again only once the container has changed
OpenedEntry open_entry(const std::string& path);

/// A descriptor of a copy of a range in memory, at most 1 GiB, for libraries that read whole files; -1 with errno.
int copy_range(int file, std::uint64_t offset, std::uint64_t bytes);

/// Whether the CRC-32 of the bytes is that of the entry, as unpackers check it. cost  reads the entry
bool has_its_sum(const std::string& container, const ContainerEntry& entry);

/// Whether a path leads through a container, or through the pages of a job, to an entry; its size. cost  some system calls
std::optional<std::uint64_t> entry_bytes(const std::string& path);

/// The names in a folder, of a directory, a container or the pages of a job, without order; empty if there is none. Of a
/// container files alone.
std::vector<std::string> names_in_folder(const std::string& folder);

}  // namespace lamina
