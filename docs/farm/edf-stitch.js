// SPDX-License-Identifier: GPL-3.0-or-later
//
// A job type of Flamenco 3: stitches a list of pairs, sets and clips, or measures rendered scenes, in as many tasks as are
// asked for. It lies in the folder `scripts` beside Flamenco Manager, whose configuration has a variable `edf`: the program's
// path on each platform.

const JOB_TYPE = {
    label: "EDF Stitch",
    description: "Stitches pairs, sets and clips of a list, or validates against rendered scenes",
    settings: [
        {
            key: "work", label: "Work", type: "string", required: true, default: "stitch a list", visible: "submission",
            choices: ["stitch a list", "validate: quick", "validate: full", "validate: sets"],
            description: "A list of pairs, sets and clips (edf batch), or rendered scenes that are measured (edf validate)",
        },
        {
            key: "list", label: "List", type: "string", subtype: "file_path", default: "",
            description: "CSV file: reference,target,name on each line, a folder of pictures, or patterns of two cameras. "
                + "Not for validation",
        },
        {
            key: "output", label: "Output Folder", type: "string", subtype: "dir_path", required: true,
            description: "What is made goes here; what is there already and up to date is not made again",
        },
        {
            key: "shards", label: "Tasks", type: "int32", default: 10, required: true, visible: "submission",
            propargs: { min: 1, max: 1000 },
            description: "How many tasks share the work, by turns: a few for each worker",
        },
        {
            key: "options", label: "Options", type: "string", default: "", visible: "submission",
            description: "More options of the command, such as --projection cylindrical --depth; quotes hold spaces together",
        },
    ],
};

const VALIDATION = "validate: ";

function compileJob(job) {
    const settings = job.settings;
    const validates = settings.work.startsWith(VALIDATION);
    if (!validates && !settings.list) {
        throw new Error("a list of pictures is needed: set List to a CSV file");
    }
    if (!(settings.shards >= 1)) {
        throw new Error("Tasks is " + settings.shards + "; at least one is needed");
    }
    const base = validates
        ? ["validate", "-o", settings.output, "--suite", settings.work.slice(VALIDATION.length)]
        : ["batch", settings.list, "-o", settings.output, "--keep-going"];
    const args = base.concat(["--resume", "--quiet"], wordsOf(settings.options || ""));
    const end = author.Task("sum up", "misc");
    for (let number = 1; number <= settings.shards; number++) {
        const share = number + "/" + settings.shards;
        const task = author.Task("shard " + share, "misc");
        task.addCommand(author.Command("exec", { exe: "{edf}", args: args.concat(["--shard", share]) }));
        job.addTask(task);
        end.addDependency(task);
    }
    // finds all of it made, and leaves one summary or report
    end.addCommand(author.Command("exec", { exe: "{edf}", args: args }));
    job.addTask(end);
}

// The words of a text as a shell has them: parted by spaces, unless these stand in quotes.
function wordsOf(text) {
    const words = text.match(/(?:[^\s"']|"[^"]*"|'[^']*')+/g) || [];
    return words.map(function (word) {
        return word.replace(/"([^"]*)"|'([^']*)'/g, function (_, double, single) {
            return double === undefined ? single : double;
        });
    });
}
