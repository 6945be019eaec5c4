// Two visits in Firefox over WebDriver BiDi: node firefox.mjs FIREFOX FOLDER_OF_PUPPETEER ADDRESS [FOLDER_OF_PICTURES]
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [firefox, folder, address, pictures] = process.argv.slice(2);
const { default: puppeteer } = await import(pathToFileURL(createRequire(`${folder}/`).resolve("puppeteer-core")));
const browser = await puppeteer.launch({ browser: "firefox", executablePath: firefox, timeout: 90_000, protocolTimeout: 240_000 });
const page = await browser.newPage();
const faults = [];
const press = (text) => page.locator(`::-p-xpath(//main//*[self::button or self::a][normalize-space()="${text}"])`).click();
const picture = async (name) => pictures && page.screenshot({ path: `${pictures}/firefox-${name}.png`, fullPage: true });
page.setDefaultTimeout(90_000);
page.on("pageerror", (error) => faults.push(String(error)));
await page.setViewport({ width: 1280, height: 900 });

// A student: the answer beside the form, the whole of it, an own L.
await page.goto(`${address}/`);
await page.$eval("#equations", (box) => { box.value = ""; });
await page.type("#equations", "x'' = -x - 0.1*x'");
await page.waitForSelector("#glance [data-settled]");
await press("Find out");
await page.waitForSelector(".verdict.variational");
await page.waitForSelector("#own-lagrangian"); // the verdict may come before the rest
await page.type("#own-lagrangian", "exp(t/10)*(x'^2 - x^2)/2");
await press("Does it give these equations?");
await page.waitForSelector("#own [role=status]");
const own = await page.$eval("#own [role=status]", (node) => node.textContent.trim());
await picture("student");

// The double pendulum: solved, played with, run by two methods.
await page.goto(`${address}/?example=double-pendulum`);
await press("Find out");
await page.waitForSelector(".verdict.variational");
await press("Simulate this");
await page.waitForSelector("[data-picture] option");
const shown = await page.$eval("[data-picture]", (node) => node.value);
await picture("double-pendulum");
await press("Run");
await page.waitForSelector("[data-drawn]");
const completed = await page.$$eval("tbody .badge.valid", (found) => found.length);
await picture("run");
console.log(JSON.stringify({ version: await browser.version(), own, shown, completed, faults }));
await browser.close();
