#pragma once

#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string>

namespace cairn {

// Which images a folder has from earlier runs, and what they were made from. A line is written
// before its image appears, so that every image of ours has its line, whenever a run is killed.
class ImageLedger {
 public:
  struct Entry {
    std::string input_hash;  // of all that decides the image
    std::string file_hash;
    bool operator==(const Entry&) const = default;
  };

  // Reads the ledger at `path`, if there is one. Throws IoError.
  explicit ImageLedger(const std::string& path);

  // Did a run write this image with these bytes, and from these inputs? Thread-safe, as Add is.
  bool IsOurs(const std::string& name, const std::string& file_hash) const;
  bool Has(const std::string& name, const Entry& entry) const;
  // Announces an image that is about to be written. Throws IoError.
  void Add(const std::string& name, const Entry& entry);

  std::set<std::string> Names() const;
  // From now on, these are the images. Call it from one thread.
  void Keep(const std::map<std::string, Entry>& entries);

 private:
  void Write();

  std::string path_;
  mutable std::mutex mutex_;
  std::multimap<std::string, Entry> entries_;  // by name, those of one in the order of the file
  std::ofstream file_;
};

}  // namespace cairn
