// Numbers with a name below each. They keep their own state: a new value draws these few words and not the page.
export default {
  template: `
    <div class="desk-row desk-numbers">
      <div v-for="(name, key) in names" :key="key" class="desk-figure" role="group" :aria-label="name">
        <span class="value" :data-figure="name">{{ now[key] }}</span>
        <span class="name">{{ name }}</span>
        <span class="was">{{ second[key] }}</span>
      </div>
    </div>`,
  props: { names: Object, start: Object },
  data() {
    return { now: this.start, second: {} };
  },
  methods: {
    show(now, second) {
      this.now = now;
      this.second = second;
    },
  },
};
