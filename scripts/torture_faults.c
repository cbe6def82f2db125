/* For LD_PRELOAD by scripts/torture: lets system calls on files of one folder fail.
   TORTURE_FOLDER: prefix of the files' paths; TORTURE_CALL: name of the call; TORTURE_AT: which one,
   from 1; TORTURE_ERRNO: its error, 0: half of what was asked for is written or read;
   TORTURE_STAYS: set, all later calls fail, too, as with a full disk.
   TORTURE_CALL=power: the power fails before the TORTURE_AT-th call that changes anything. What was
   written since the last sync of its file is lost, all of it, or with TORTURE_SEED > 0 each write
   with chance 1/2; names (files made, renamed, removed) stay in their order, as on a file system
   with a journal. Then the program is killed.
   TORTURE_CALL=clock: from the TORTURE_AT-th look on, the time of day is TORTURE_JUMP seconds off. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

static atomic_int num_calls;

static int IsInFolder(const char* path) {
  const char* folder = getenv("TORTURE_FOLDER");
  return folder && path && strncmp(path, folder, strlen(folder)) == 0;
}

static int GetPath(int descriptor, char path[4096]) {
  char link[64];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", descriptor);
  const ssize_t size = readlink(link, path, 4095);
  if (size <= 0) return 0;
  path[size] = 0;
  return 1;
}

static int IsOfFolder(int descriptor) {
  char path[4096];
  return GetPath(descriptor, path) && IsInFolder(path);
}

/* Is it this call's turn? `*error` is then what it fails with. */
static int Fails(const char* call, int* error) {
  const char* wanted = getenv("TORTURE_CALL");
  if (!wanted || strcmp(wanted, call) != 0) return 0;
  const int at = atoi(getenv("TORTURE_AT"));
  const int number = atomic_fetch_add(&num_calls, 1) + 1;
  if (number != at && !(number > at && getenv("TORTURE_STAYS"))) return 0;
  *error = atoi(getenv("TORTURE_ERRNO"));
  return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* ---- Loss of power ---- */
typedef struct Write { /* since the last sync of its file */
  struct Write* earlier;
  off64_t at;
  size_t size;
  char old[]; /* what was there; zeros beyond the end of the file */
} Write;
typedef struct File {
  struct File* next;
  dev_t device;
  ino_t inode;
  int descriptor; /* stays open: closing it would drop the locks of SQLite */
  off64_t synced_size;
  Write* last;
} File;
static File* files;
static pthread_mutex_t power = PTHREAD_MUTEX_INITIALIZER; /* held while anything is changed */

static off64_t SizeOf(int descriptor) {
  struct stat status;
  return fstat(descriptor, &status) == 0 ? status.st_size : 0;
}

/* NULL: not known, or (the shared memory of SQLite) nothing that is kept. */
static File* FileOf(int descriptor, int is_changed) {
  struct stat status;
  char path[4096];
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return NULL;
  for (File* file = files; file; file = file->next) {
    if (file->device == status.st_dev && file->inode == status.st_ino) return file;
  }
  if (!is_changed || !GetPath(descriptor, path)) return NULL;
  if (strlen(path) > 4 && strcmp(path + strlen(path) - 4, "-shm") == 0) return NULL;
  File* const file = malloc(sizeof(File));
  snprintf(path, sizeof(path), "/proc/self/fd/%d", descriptor);
  *file = (File){files, status.st_dev, status.st_ino, REAL(open)(path, O_RDWR | O_CLOEXEC), status.st_size, NULL};
  return files = file;
}

static void Forget(File* file) {
  while (file->last) {
    Write* const earlier = file->last->earlier;
    free(file->last);
    file->last = earlier;
  }
}

/* Leaves of the file what the disk has. */
static void LoseWrites(File* file, unsigned seed) {
  off64_t size = file->synced_size;
  for (const Write* write = file->last; write; write = write->earlier) {
    const off64_t end = write->at + (off64_t)write->size;
    if (seed && rand_r(&seed) / (RAND_MAX / 2 + 1)) {
      if (end > size) size = end;
    } else {
      REAL(pwrite64)(file->descriptor, write->old, write->size, write->at);
    }
  }
  REAL(ftruncate64)(file->descriptor, size);
}

static int HasPower(void) {
  const char* wanted = getenv("TORTURE_CALL");
  return wanted && strcmp(wanted, "power") == 0;
}

/* Before and after a call that changes something in the folder. */
static int BeginChange(int is_ours) {
  if (!is_ours || !HasPower()) return 0;
  pthread_mutex_lock(&power);
  if (++num_calls < atoi(getenv("TORTURE_AT"))) return 1;
  for (File* file = files; file; file = file->next) {
    LoseWrites(file, (unsigned)atoi(getenv("TORTURE_SEED")));
  }
  kill(getpid(), SIGKILL);
  pause();
  return 1;
}
static void EndChange(int is_change) {
  if (is_change) pthread_mutex_unlock(&power);
}

static void Overwrite(int descriptor, off64_t at, size_t size) {
  File* const file = FileOf(descriptor, 1);
  Write* const write = file ? calloc(1, sizeof(Write) + size) : NULL;
  if (!write) return;
  write->earlier = file->last;
  write->at = at;
  write->size = size;
  if (REAL(pread64)(file->descriptor, write->old, size, at) < 0) memset(write->old, 0, size);
  file->last = write;
}

static void Truncate(int descriptor, off64_t size) {
  File* const file = FileOf(descriptor, 1);
  if (!file) return;
  if (size < file->synced_size) file->synced_size = size;
  for (Write* write = file->last; write; write = write->earlier) {
    const off64_t rest = size > write->at ? size - write->at : 0;
    if ((off64_t)write->size > rest) write->size = (size_t)rest;
  }
}

static void Synced(int descriptor) {
  File* const file = FileOf(descriptor, 0);
  if (!file) return;
  Forget(file);
  file->synced_size = SizeOf(descriptor);
}

/* ---- Calls ---- */
/* One that moves `count` bytes; `before`: what a change has to do first. */
#define MOVING(name, is_change, before, parameters, arguments, half_arguments) \
  ssize_t name parameters {                                                    \
    int error = 0;                                                             \
    const int is_ours = IsOfFolder(fd);                                        \
    if (is_ours && Fails(#name, &error)) {                                     \
      if (error == 0 && count > 1) return REAL(name) half_arguments;           \
      if (error == 0) return REAL(name) arguments;                             \
      errno = error;                                                           \
      return -1;                                                               \
    }                                                                          \
    const int begun = BeginChange(is_ours && is_change);                       \
    if (begun) before;                                                         \
    const ssize_t result = REAL(name) arguments;                               \
    EndChange(begun);                                                          \
    return result;                                                             \
  }
static off64_t Position(int fd) {
  return fcntl(fd, F_GETFL) & O_APPEND ? SizeOf(fd) : lseek64(fd, 0, SEEK_CUR);
}
MOVING(write, 1, Overwrite(fd, Position(fd), count), (int fd, const void* data, size_t count),
       (fd, data, count), (fd, data, count / 2))
MOVING(read, 0, (void)0, (int fd, void* data, size_t count), (fd, data, count),
       (fd, data, count / 2))
MOVING(pwrite64, 1, Overwrite(fd, at, count),
       (int fd, const void* data, size_t count, off64_t at), (fd, data, count, at),
       (fd, data, count / 2, at))
MOVING(pread64, 0, (void)0, (int fd, void* data, size_t count, off64_t at), (fd, data, count, at),
       (fd, data, count / 2, at))

#define CHANGING(name, is_ours, before, after, parameters, arguments) \
  int name parameters {                                               \
    int error = 0;                                                    \
    if (is_ours && Fails(#name, &error)) {                            \
      errno = error ? error : EIO;                                    \
      return -1;                                                      \
    }                                                                 \
    const int begun = BeginChange(is_ours);                           \
    if (begun) before;                                                \
    const int result = REAL(name) arguments;                          \
    if (begun && result == 0) after;                                  \
    EndChange(begun);                                                 \
    return result;                                                    \
  }
CHANGING(fsync, IsOfFolder(fd), (void)0, Synced(fd), (int fd), (fd))
CHANGING(fdatasync, IsOfFolder(fd), (void)0, Synced(fd), (int fd), (fd))
CHANGING(ftruncate64, IsOfFolder(fd), Truncate(fd, size), (void)0, (int fd, off64_t size), (fd, size))
CHANGING(rename, IsInFolder(to), (void)0, (void)0, (const char* from, const char* to), (from, to))
CHANGING(unlink, IsInFolder(path), (void)0, (void)0, (const char* path), (path))
CHANGING(mkdir, IsInFolder(path), (void)0, (void)0, (const char* path, mode_t mode), (path, mode))

static mode_t ModeOf(int flags, va_list list) {
  return flags & (O_CREAT | O_TMPFILE) ? va_arg(list, mode_t) : 0;
}
#define OPENING(name)                                                            \
  int name(const char* path, int flags, ...) {                                   \
    va_list list;                                                                \
    va_start(list, flags);                                                       \
    const mode_t mode = ModeOf(flags, list);                                     \
    va_end(list);                                                                \
    int error = 0;                                                               \
    if (IsInFolder(path) && Fails("open", &error)) {                             \
      errno = error ? error : EIO;                                               \
      return -1;                                                                 \
    }                                                                            \
    const int begun = BeginChange(IsInFolder(path) && flags & (O_CREAT | O_TRUNC)); \
    const int descriptor = REAL(name)(path, flags, mode);                        \
    if (begun && descriptor >= 0 && flags & O_TRUNC) Truncate(descriptor, 0);    \
    EndChange(begun);                                                            \
    return descriptor;                                                           \
  }
OPENING(open)
OPENING(open64)

/* The calls of stdio do not come by here, but its functions do. What they write is in no list: it
   is beyond the synced size, and lost. */
FILE* fopen64(const char* path, const char* mode) {
  int error = 0;
  if (IsInFolder(path) && Fails("fopen", &error)) {
    errno = error ? error : EIO;
    return NULL;
  }
  const int begun = BeginChange(IsInFolder(path) && mode[0] != 'r');
  FILE* const file = REAL(fopen64)(path, mode);
  if (begun && file) Truncate(fileno(file), mode[0] == 'w' ? 0 : SizeOf(fileno(file)));
  EndChange(begun);
  return file;
}
size_t fwrite(const void* data, size_t size, size_t count, FILE* file) {
  int error = 0;
  if (IsOfFolder(fileno(file)) && Fails("fwrite", &error)) {
    errno = error ? error : ENOSPC;
    return 0;
  }
  return REAL(fwrite)(data, size, count, file);
}
int fflush(FILE* file) {
  int error = 0;
  if (file && IsOfFolder(fileno(file)) && Fails("fflush", &error)) {
    errno = error ? error : ENOSPC;
    return EOF;
  }
  const int begun = BeginChange(file && IsOfFolder(fileno(file)));
  const int result = REAL(fflush)(file);
  EndChange(begun);
  return result;
}

/* ---- Clock ---- */
static time_t Jump(void) {
  int unused = 0;
  const char* jump = getenv("TORTURE_JUMP");
  if (!jump) return 0;
  return Fails("clock", &unused) ? (time_t)atoll(jump) : 0;
}
int clock_gettime(clockid_t clock, struct timespec* now) {
  const int result = REAL(clock_gettime)(clock, now);
  if (result == 0 && clock == CLOCK_REALTIME) now->tv_sec += Jump();
  return result;
}
int gettimeofday(struct timeval* now, void* zone) {
  const int result = REAL(gettimeofday)(now, zone);
  if (result == 0) now->tv_sec += Jump();
  return result;
}
time_t time(time_t* now) {
  const time_t result = REAL(time)(NULL) + Jump();
  if (now) *now = result;
  return result;
}
