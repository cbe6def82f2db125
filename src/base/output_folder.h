#pragma once

#include <map>
#include <string>
#include <vector>

namespace cairn {

// The results of one run in a folder that may hold other things, too. Files are written to a
// folder beside their places, and appear there together at Commit(): once all are on the disk, one
// rename decides that they are the results, and what is interrupted after it is finished by the
// next run. Files that cairn wrote are listed in .cairn-files with a hash of each; a file that is
// not listed, or that has changed since, is somebody else's. The list names its writer, and a
// folder has one.
class OutputFolder {
 public:
  // `writer`: the command. `names`: files and folders in `path` that its results may have. Makes
  // the folder, removes what a killed run left there, and throws ConfigError where the folder is
  // another command's or, unless `overwrites`, somebody else's file is in the way. Throws IoError:
  // cannot be written to, or another run is writing.
  OutputFolder(const std::string& path, const std::string& writer,
               const std::vector<std::string>& names, bool overwrites);
  ~OutputFolder();  // without Commit(): the folder is as it was
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  // Where the results are written before Commit().
  const std::string& staging() const { return staging_; }
  // Is a file whose name begins like this among the results of an earlier run?
  bool Has(const std::string& name) const;
  // Puts the results in place. Those of earlier runs, and with `overwrites` all else that has one
  // of the names, are removed; earlier results outside of the folder `within`, one of the names,
  // stay.
  void Commit(const std::string& within = "");

 private:
  using Hashes = std::map<std::string, std::string>;  // hash of each file, by path in the folder

  std::vector<std::string> FilesInTheWay() const;
  bool IsOurs(const std::string& name) const;
  void CheckOneWriter() const;
  void CheckNobodyElses() const;
  void Apply();

  std::string path_, writer_, staging_, committed_;
  std::vector<std::string> names_;
  bool overwrites_;
  int lock_ = -1;
  Hashes earlier_;
};

// Throws ConfigError where one of the files in the folder is a result of another command.
void CheckNotOfAnother(const std::string& folder, const std::string& writer,
                       const std::vector<std::string>& files);

// A file that a command has written to a folder of results, again: if it is one of these, it stays
// one.
void RecordRewritten(const std::string& file);

}  // namespace cairn
